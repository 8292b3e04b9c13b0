"""Arguments of callers as arrays that the compiled module reads. Errors name the argument, the place and a remedy."""

from __future__ import annotations

import numbers
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._pbig import MAX_BOXES

# An unused place for the vertex of a face.
NO_VERTEX = 2**32 - 1


def boxes(name: str, values: ArrayLike) -> NDArray[Any]:
    """Returns boxes as rows of six numbers, without a copy if they are so already."""
    array = np.asarray(values)
    if array.shape[1:] not in ((6,), (2, 3)):
        raise _wrong_shape(name, array, "(n, 6), with min xyz and max xyz in a row, or (n, 2, 3)")
    _check_rows(name, array)
    return np.require(array, _float_type(name, array), ["C", "A"]).reshape(-1, 6)


def vertices(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Returns the places of vertices."""
    array = np.asarray(values)
    if array.shape[1:] != (3,):
        raise _wrong_shape(name, array, "(n, 3), with the xyz of a vertex in a row")
    _check_rows(name, array)
    _float_type(name, array)
    return np.require(array, np.float64, ["C", "A"])


def after(values: ArrayLike, before: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the places of vertices at the end of a step."""
    array = vertices("after", values)
    if len(array) != len(before):
        raise ValueError(f"after has {len(array)} rows, vertices {len(before)}; give all vertices at the end of the step")
    return array


def faces(values: ArrayLike, vertex_count: int) -> NDArray[np.uint32]:
    """Returns faces as rows of four vertices. A triangle has `NO_VERTEX` last."""
    array = np.asarray(values)
    if array.shape[1:] not in ((3,), (4,)):
        raise _wrong_shape("faces", array, "(n, 3) for triangles, or (n, 4) for quadrilaterals")
    rows = np.full((len(array), 4), NO_VERTEX, np.uint32)
    rows[:, : array.shape[1]] = _indices("faces", array, "the index of a vertex", vertex_count)
    return rows


def ids(values: ArrayLike) -> NDArray[np.uint32]:
    """Returns ids of boxes."""
    array = np.asarray(values)
    if array.ndim != 1:
        raise _wrong_shape("ids", array, "(n,), with an id for each box")
    return np.require(_indices("ids", array, "an id", MAX_BOXES), np.uint32, ["C", "A"])


def margin(value: float) -> float:
    """Returns a length by which boxes grow."""
    if not isinstance(value, numbers.Real):
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


def _indices(name: str, array: NDArray[Any], what: str, limit: int) -> NDArray[Any]:
    # Numpy makes floats of an empty list.
    if array.dtype.kind not in "iu" and array.size > 0:
        raise TypeError(f"{name} has values of the type {array.dtype}; give whole numbers, such as int64")
    wrong = np.argwhere((array < 0) | (array >= limit))
    if len(wrong) > 0:
        place = tuple(wrong[0].tolist())
        where = ", ".join(map(str, place))
        raise ValueError(f"{name}[{where}] is {array[place]}; {what} must be at least 0 and below {limit}")
    return array


def _float_type(name: str, array: NDArray[Any]) -> type[np.floating[Any]]:
    if array.dtype.kind == "f" and array.dtype.itemsize in (4, 8):
        return np.float32 if array.dtype.itemsize == 4 else np.float64
    remedy = f"give float32 or float64, such as numpy.asarray({name}, dtype=float)"
    raise TypeError(f"{name} has values of the type {array.dtype}; {remedy}")


def _check_rows(name: str, array: NDArray[Any]) -> None:
    if len(array) > MAX_BOXES:
        raise ValueError(f"{name} has {len(array)} rows, more than {MAX_BOXES}; split it, and search the parts")


def _wrong_shape(name: str, array: NDArray[Any], wanted: str) -> ValueError:
    return ValueError(f"{name} has the shape {array.shape}; give {wanted}")
