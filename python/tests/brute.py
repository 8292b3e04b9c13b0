"""Pairs by testing all, for comparison. No code is shared with the package."""

from fractions import Fraction
from itertools import combinations, product

import numpy as np


def outward(boxes):
    """Returns the smallest boxes in float32 around boxes in float64. Invalid ones become NaN."""
    boxes = np.asarray(boxes).reshape(-1, 6)
    if boxes.dtype == np.float32:
        return boxes
    with np.errstate(over="ignore"):
        near = boxes.astype(np.float32)
    low = np.where(near > boxes, np.nextafter(near, np.float32(-np.inf)), near)[:, :3]
    high = np.where(near < boxes, np.nextafter(near, np.float32(np.inf)), near)[:, 3:]
    valid = (boxes[:, :3] <= boxes[:, 3:]).all(axis=1, keepdims=True)
    return np.where(valid, np.hstack([low, high]), np.float32(np.nan))


def overlaps(a, b):
    """Returns the matrix of what overlaps."""
    valid = [(boxes[:, :3] <= boxes[:, 3:]).all(axis=1) for boxes in (a, b)]
    matrix = valid[0][:, None] & valid[1]
    for k in range(3):
        matrix &= (a[:, None, k] <= b[:, k + 3]) & (b[:, k] <= a[:, None, k + 3])
    return matrix


def between(a, b):
    """Returns pairs of rows of two sets, sorted."""
    a, b = outward(a), outward(b)
    parts = [np.argwhere(overlaps(a[first : first + 1000], b)) + [first, 0] for first in range(0, len(a), 1000)]
    return np.vstack([np.empty((0, 2), int), *parts]).tolist()


def pairs(boxes):
    """Returns pairs of rows, sorted."""
    return [pair for pair in between(boxes, boxes) if pair[0] < pair[1]]


def edges(faces):
    """Returns the edges: smaller and larger vertex, sorted by the larger one first."""
    sides = [side for face in faces for side in zip(face, [*face[1:], face[0]])]
    return sorted({(min(side), max(side)) for side in sides if side[0] != side[1]}, key=lambda edge: edge[::-1])


def elements(kind, vertex_count, faces):
    """Returns the vertices of each element of a kind."""
    every = {"v": [(v,) for v in range(vertex_count)], "e": edges(faces), "f": [tuple(face) for face in faces]}
    return every[kind]


def down(x):
    """Returns the largest float32 that is not above a fraction."""
    near = np.float32(float(x))
    return np.nextafter(near, np.float32(-np.inf)) if Fraction(float(near)) > x else near


def box_around(vertices, frames, margin):
    """Returns the box around vertices in all frames, in exact arithmetic but for one rounding to float32."""
    places = np.vstack([frame[list(vertices)] for frame in frames])
    if np.isnan(places).any():
        return [np.nan] * 6
    places = [[Fraction(float(x)) for x in place] for place in places]
    margin = Fraction(float(margin))
    low = [down(min(place[k] for place in places) - margin) for k in range(3)]
    high = [-down(-max(place[k] for place in places) - margin) for k in range(3)]
    return low + high


def mesh_pairs(kinds, frames, faces, margin):
    """Returns pairs of elements that share no vertex, sorted."""
    a, b = (elements(kind, len(frames[0]), faces) for kind in kinds)
    boxes = [np.array([box_around(one, frames, margin) for one in every], np.float32).reshape(-1, 6) for every in (a, b)]
    matrix = overlaps(*boxes)
    is_one_kind = kinds[0] == kinds[1]
    every = combinations(range(len(a)), 2) if is_one_kind else product(range(len(a)), range(len(b)))
    return [[i, j] for i, j in every if matrix[i, j] and not set(a[i]) & set(b[j])]
