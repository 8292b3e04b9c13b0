"""Finds every pair of overlapping axis-aligned boxes, and candidate pairs of a mesh, in arrays of numpy.

Searches use all cores (the environment variable RAYON_NUM_THREADS sets another number), and other Python threads go on
meanwhile. Coordinates have any unit of length, the same in all arguments.
"""

from __future__ import annotations

from typing import Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _checks, _pbig
from ._pbig import __version__

__all__ = ["BroadPhase", "__version__", "edges", "mesh_pairs", "pairs", "pairs_between"]

# Two indices in a row: shape (m, 2).
Pairs = NDArray[np.uint32]


def pairs(boxes: ArrayLike) -> Pairs:
    """Returns every pair of overlapping boxes.

    Boxes are closed: two that touch overlap. A box with a NaN, or a minimum above its maximum, pairs with nothing, and a
    UserWarning tells of it. Extents may be infinite. For a margin r give `boxes + [-r, -r, -r, r, r, r]`. Whole numbers
    become float64. Boxes in float64 are rounded outward to float32, so no pair is missed. A float32 array in C order is
    read in place: no other thread may write to it meanwhile.

    Args:
        boxes: float32, float64 or whole numbers, shape (n, 6), min xyz and max xyz in a row, or (n, 2, 3). At most 2**27.

    Returns:
        uint32, shape (m, 2): each row i < j, sorted by i, then j.

    Raises:
        TypeError: The values are not float32, float64 or whole numbers.
        ValueError: The shape is another, there are too many boxes, or more than 2**28 pairs.

    >>> boxes = [[0, 0, 0, 1, 1, 1], [1, 0, 0, 2, 1, 1], [5, 5, 5, 6, 6, 6]]
    >>> pbig.pairs(boxes).tolist()
    [[0, 1]]
    """
    rows = _checks.boxes("boxes", boxes)
    found, invalid = _pbig.pairs(rows)
    if invalid > 0:
        _checks.warn_of_invalid("boxes", rows)
    return found


def pairs_between(a: ArrayLike, b: ArrayLike) -> Pairs:
    """Returns every pair of a box of `a` and a box of `b` that overlap.

    Boxes of one set are not compared with each other.

    Args:
        a: Boxes, as in `pairs`.
        b: Boxes, as in `pairs`. Both sets together have at most 2**27.

    Returns:
        uint32, shape (m, 2): row of `a`, row of `b`, sorted.

    Raises:
        TypeError, ValueError: As in `pairs`.

    >>> a = numpy.array([[0, 0, 0, 1, 1, 1], [5, 0, 0, 6, 1, 1]], dtype=float)
    >>> pbig.pairs_between(a, a[::-1] + 0.5).tolist()
    [[0, 1], [1, 0]]
    """
    rows, others = _checks.boxes("a", a), _checks.boxes("b", b)
    found, invalid = _pbig.pairs_between(rows, others)
    if invalid > 0:
        _checks.warn_of_invalid("a", rows)
        _checks.warn_of_invalid("b", others)
    return found


def mesh_pairs(
    vertices: ArrayLike,
    faces: ArrayLike,
    after: Optional[ArrayLike] = None,
    margin: float = 0.0,
    elements: str = "ee,vf",
    edges: Optional[ArrayLike] = None,
) -> dict[str, Pairs]:
    """Returns candidate pairs of elements of a mesh: elements that share no vertex, and whose boxes overlap.

    An element pairs with nothing if one of its vertices has a NaN. A UserWarning says so, and tells of vertices beyond
    float32 and faces that name a vertex twice; `warnings.simplefilter("error")` makes errors of them.

    Args:
        vertices: float32, float64 or whole numbers, shape (n, 3): a place in a row.
        faces: Whole numbers, shape (m, 3) or (m, 4): the vertices of a face in a row, counted from 0.
        after: The vertices at the end of a step. A box then holds its element on the straight way there.
        margin: Length by which each box grows on all sides, rounded outward: half a thickness.
        elements: Entries of two kinds, v (vertex), e (edge) or f (face), with commas between them.
        edges: Whole numbers, shape (k, 2): two vertices in a row, in place of `pbig.edges(faces)`: in an order of your
            own, or with rods, edges without a face.

    Returns:
        For each entry uint32, shape (k, 2), sorted: the first kind in the first column. For two of one kind each row
        is i < j. An edge is a row of `edges`, or of `pbig.edges(faces)`.

    Raises:
        TypeError: Values or an argument have a wrong type.
        ValueError: A shape is wrong, an index is not that of a vertex, the margin is negative or not finite, `elements`
            has an unknown entry, there are more than 2**27 elements, or more than 2**28 pairs.

    >>> vertices = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, 0.1]]
    >>> candidates = pbig.mesh_pairs(vertices, [[0, 1, 2]], margin=0.05)
    >>> candidates["vf"].tolist(), candidates["ee"].tolist()
    ([[3, 0]], [])
    """
    kinds = _checks.kinds(elements)
    before = _checks.vertices("vertices", vertices)
    rows = _checks.faces(faces, len(before))
    own = None if edges is None else _checks.edges(edges, len(before))
    later = before if after is None else _checks.vertices("after", after)
    _checks.same_count(before, later)
    found = _pbig.mesh_pairs((before, later), rows, own, _checks.margin(margin), [tuple(kind) for kind in kinds])
    return dict(zip(kinds, found))


def edges(faces: ArrayLike) -> Pairs:
    """Returns the edges of faces. Row k is the edge k of `mesh_pairs`, and of the program `pbig`.

    Args:
        faces: As in `mesh_pairs`.

    Returns:
        uint32, shape (k, 2): each edge once, its smaller and then its larger vertex, sorted by the larger one first.

    Raises:
        TypeError, ValueError: As in `mesh_pairs`.

    >>> pbig.edges([[0, 1, 2], [2, 1, 3]]).tolist()
    [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]
    """
    return _pbig.edges(_checks.faces(faces, _pbig.MAX_BOXES))


class BroadPhase:
    """Boxes by id, and the pairs between them, kept from update to update.

    The fewer boxes have changed, the less time an update takes. Each id up to the largest takes memory, used or not, so
    number boxes densely from 0. Several threads may use one object; each call waits for the one before.

    Args:
        margin: Length by which a box is stored larger than given, on all sides. While a box stays inside its stored
            one nothing changes. Pairs are those of the stored boxes.

    Raises:
        TypeError: The margin is not a number.
        ValueError: The margin is negative or not finite in float32.

    >>> broad_phase = pbig.BroadPhase()
    >>> broad_phase.set_all([[0, 0, 0, 1, 1, 1], [2, 0, 0, 3, 1, 1]])
    >>> added, removed = broad_phase.update()
    >>> len(added)
    0
    >>> broad_phase.set([1], [[1, 0, 0, 2, 1, 1]])
    >>> added, removed = broad_phase.update()
    >>> added.tolist(), removed.tolist()
    ([[0, 1]], [])
    """

    def __init__(self, margin: float = 0.0) -> None:
        self._native = _pbig.BroadPhase(_checks.margin(margin))

    def set(self, ids: ArrayLike, boxes: ArrayLike) -> None:
        """Inserts boxes, or moves them.

        Args:
            ids: Whole numbers, shape (n,). If an id is there twice, its last box counts.
            boxes: A box for each id, as in `pairs`. An invalid box (see there) pairs with nothing until it is set again.

        Raises:
            TypeError: Values have a wrong type.
            ValueError: Ids and boxes differ in number, or an id is negative, not below 2**27, or far above all others.
                In the last case the boxes before it are set.
        """
        numbers, rows = _checks.ids(ids), _checks.boxes("boxes", boxes)
        if len(numbers) != len(rows):
            raise ValueError(f"{len(numbers)} ids for {len(rows)} boxes; give one id for each box")
        self._native.set(numbers, rows)

    def set_all(self, boxes: ArrayLike) -> None:
        """Sets all boxes: row i is the box with the id i. Boxes with other ids are removed, as by `remove`.

        Args:
            boxes: As in `pairs`.

        Raises:
            TypeError, ValueError: As in `pairs`.
        """
        self._native.set_all(_checks.boxes("boxes", boxes))

    def remove(self, ids: ArrayLike) -> int:
        """Removes boxes. Their pairs are gone at once, and no update lists them.

        To have these pairs in `removed` of the next update, set the boxes to NaN.

        Args:
            ids: Whole numbers, shape (n,). Ids without a box are skipped.

        Returns:
            The number of boxes that were there.

        Raises:
            TypeError: The ids are not whole numbers.
            ValueError: An id is negative, or not below 2**27.
        """
        return self._native.remove(_checks.ids(ids))

    def update(self) -> tuple[Pairs, Pairs]:
        """Returns the pairs that were added and removed since the last update.

        Pairs of boxes that `remove` took out are in neither. If such an id was set again, its pairs are in `added`, also
        those that existed before.

        Returns:
            Two arrays as in `pairs`.

        Raises:
            ValueError: There are more than 2**28 pairs. The next update sees the same changes again.
        """
        return self._native.update()

    def pairs(self) -> Pairs:
        """Returns the pairs of the last update, without those of boxes removed since, as an array as in `pbig.pairs`."""
        return self._native.pairs()

    def __len__(self) -> int:
        """Returns the number of boxes, invalid ones included."""
        return len(self._native)
