"""Arguments of callers as arrays that the compiled module reads. Errors name the argument, the place and a remedy."""

from __future__ import annotations

import numbers
import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._pbig import MAX_BOXES

# An unused place for the vertex of a face.
NO_VERTEX = 2**32 - 1

# The largest finite float32.
LARGEST = float(np.finfo(np.float32).max)


def boxes(name: str, values: ArrayLike) -> NDArray[Any]:
    """Returns boxes as rows of six numbers, without a copy if they are so already."""
    array = _array(name, values, 6)
    if array.shape[1:] not in ((6,), (2, 3)):
        raise _wrong_shape(name, array, "(n, 6), with min xyz and max xyz in a row, or (n, 2, 3)")
    _check_rows(name, array)
    return np.require(array, _float_type(name, array), ["C", "A"]).reshape(-1, 6)


def vertices(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Returns the places of vertices. Warns of those that are no places."""
    array = _array(name, values, 3)
    if array.ndim == 0:
        raise ValueError(f"{name} is one number; give vertices, shape (n, 3); a margin is given as margin={array}")
    if array.shape[1:] != (3,):
        raise _wrong_shape(name, array, "(n, 3), with the xyz of a vertex in a row; in 2D add a column of zeros, and ask for elements='ee,ev'")
    _check_rows(name, array)
    _float_type(name, array)
    with np.errstate(invalid="ignore"):
        places = np.require(array, np.float64, ["C", "A"])
    if not (places.max(initial=0) <= LARGEST and places.min(initial=0) >= -LARGEST):
        _warn(name, np.isnan(places).any(axis=1), "with a NaN", "elements there pair with nothing")
        _warn(name, (np.abs(places) > LARGEST).any(axis=1), "beyond float32", "boxes there are infinite")
    return places


def same_count(before: NDArray[np.float64], after: NDArray[np.float64]) -> None:
    """Checks that both frames of a step have all vertices."""
    if len(after) != len(before):
        raise ValueError(f"after has {len(after)} rows, vertices {len(before)}; give all vertices at the end of the step")


def faces(values: ArrayLike, vertex_count: int) -> NDArray[np.uint32]:
    """Returns faces as rows of four vertices. A triangle has `NO_VERTEX` last. Warns of faces that name a vertex twice."""
    array = _array("faces", values, 3)
    if array.shape[1:] == (2,):
        raise _wrong_shape("faces", array, "(n, 3) or (n, 4): these are edges, which are given as edges=")
    if array.shape[1:] not in ((3,), (4,)):
        raise _wrong_shape("faces", array, "(n, 3) for triangles, or (n, 4) for quadrilaterals")
    rows = np.full((len(array), 4), NO_VERTEX, np.uint32)
    rows[:, : array.shape[1]] = _indices("faces", array, "the index of a vertex", vertex_count)
    corners = array.T
    are_doubled = [corners[i] == corners[j] for i in range(len(corners)) for j in range(i)]
    _warn("faces", np.logical_or.reduce(are_doubled), "that name a vertex twice", "they stay, with fewer edges")
    return rows


def edges(values: ArrayLike, vertex_count: int) -> NDArray[np.uint32]:
    """Returns edges as rows of two vertices."""
    array = _array("edges", values, 2)
    if array.shape[1:] != (2,):
        raise _wrong_shape("edges", array, "(k, 2), with the two vertices of an edge in a row")
    _check_rows("edges", array)
    return np.require(_indices("edges", array, "the index of a vertex", vertex_count), np.uint32, ["C", "A"])


def warn_of_invalid(name: str, rows: NDArray[Any]) -> None:
    """Warns of boxes that pair with nothing."""
    are_valid = np.logical_and.reduce(rows[:, :3] <= rows[:, 3:], axis=1)
    _warn(name, ~are_valid, "with a NaN or a minimum above its maximum", "they pair with nothing; a row is min xyz, max xyz")


def ids(values: ArrayLike) -> NDArray[np.uint32]:
    """Returns ids of boxes."""
    array = _array("ids", values)
    if array.ndim != 1:
        raise _wrong_shape("ids", array, "(n,), with an id for each box")
    return np.require(_indices("ids", array, "an id", MAX_BOXES), np.uint32, ["C", "A"])


def margin(value: float) -> float:
    """Returns a length by which boxes grow."""
    value = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    if not isinstance(value, numbers.Real) or isinstance(value, bool):
        raise TypeError(f"margin has the type {type(value).__name__}; give a number")
    if not 0 <= value < float("inf"):
        raise ValueError(f"margin is {value}; give a finite length of at least 0")
    return float(value)


def kinds(text: str) -> list[str]:
    """Returns the entries of a list such as `ee,vf`."""
    if not isinstance(text, str):
        raise TypeError(f"elements has the type {type(text).__name__}; give a text such as 'ee,vf'")
    entries = [entry.strip() for entry in text.split(",")]
    for entry in entries:
        if len(entry) != 2 or not set(entry) <= set("vef"):
            raise ValueError(f"elements has '{entry}'; give two of v (vertex), e (edge) and f (face), such as 'ee,vf'")
    return entries


def _array(name: str, values: ArrayLike, *columns: int) -> NDArray[Any]:
    """Returns an array. An empty list has the columns that it should have."""
    ragged = ValueError(f"{name} has rows of different lengths; give as many numbers in each")
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ragged if "inhomogeneous" in str(error) else error from None
    if array.dtype.kind == "O" and array.ndim == 1 and array.size > 0:
        raise ragged
    if array.ndim == 0 and array.dtype.kind in "OUS":
        raise TypeError(f"{name} has the type {type(values).__name__}; give an array of numbers")
    return array.reshape(0, *columns) if array.shape == (0,) else array


def _warn(name: str, are_odd: NDArray[np.bool_], what: str, result: str) -> None:
    """Warns the caller of a function of the package of odd rows, if there are any."""
    rows = np.flatnonzero(are_odd)
    if len(rows) > 0:
        # This function, its caller, and the package's function.
        warnings.warn(f"{name} has {len(rows)} rows {what}, the first is row {rows[0]}: {result}", stacklevel=4)


def _indices(name: str, array: NDArray[Any], what: str, limit: int) -> NDArray[Any]:
    if array.size == 0:
        # Of any type: numpy makes floats of an empty list.
        return np.zeros(array.shape, np.uint32)
    if array.dtype.kind not in "iu":
        raise TypeError(f"{name} has values of the type {array.dtype}; give whole numbers, such as int64")
    wrong = np.argwhere((array < 0) | (array >= limit))
    if len(wrong) > 0:
        place = tuple(wrong[0].tolist())
        where = ", ".join(map(str, place))
        raise ValueError(f"{name}[{where}] is {array[place]}; {what} must be at least 0 and below {limit}")
    return array


def _float_type(name: str, array: NDArray[Any]) -> type[np.floating[Any]]:
    """Returns float32 for float32, and float64 for float64 and whole numbers."""
    if array.dtype.kind in "iu":
        return np.float64
    if array.dtype.kind == "f" and array.dtype.itemsize in (4, 8):
        return np.float32 if array.dtype.itemsize == 4 else np.float64
    remedy = f"give float32, float64 or whole numbers, such as numpy.asarray({name}, dtype=float)"
    raise TypeError(f"{name} has values of the type {array.dtype}; {remedy}")


def _check_rows(name: str, array: NDArray[Any]) -> None:
    if len(array) > MAX_BOXES:
        raise ValueError(f"{name} has {len(array)} rows, more than {MAX_BOXES}; split it, and search the parts")


def _wrong_shape(name: str, array: NDArray[Any], wanted: str) -> ValueError:
    return ValueError(f"{name} has the shape {array.shape}; give {wanted}")
