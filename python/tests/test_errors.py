"""Errors name what is wrong, where, and what to do."""

import os

import numpy as np
import pytest

import pbig

BOXES = np.zeros((4, 6))
VERTICES = np.zeros((8, 3))
FACES = [[0, 1, 2], [3, 4, 5]]


def mesh(**changes):
    return lambda: pbig.mesh_pairs(**{"vertices": VERTICES, "faces": FACES, **changes})


def set_(ids, boxes):
    return lambda: pbig.BroadPhase().set(ids, boxes)


ERRORS = [
    (lambda: pbig.pairs(np.zeros((3, 5))), ValueError, "boxes has the shape (3, 5); give (n, 6), with min xyz"),
    (lambda: pbig.pairs(np.zeros(6)), ValueError, "boxes has the shape (6,); give (n, 6)"),
    (lambda: pbig.pairs(np.zeros((3, 3, 2))), ValueError, "boxes has the shape (3, 3, 2); give"),
    (lambda: pbig.pairs(0.5), ValueError, "boxes has the shape (); give"),
    (lambda: pbig.pairs(BOXES.astype(bool)), TypeError, "boxes has values of the type bool; give float32, float64 or whole"),
    (lambda: pbig.pairs(BOXES.astype(np.float16)), TypeError, "float16; give float32, float64 or whole numbers, such as nump"),
    (lambda: pbig.pairs(BOXES.astype(complex)), TypeError, "boxes has values of the type complex128"),
    (lambda: pbig.pairs(BOXES.astype(object)), TypeError, "boxes has values of the type object"),
    (lambda: pbig.pairs([["a"] * 6]), TypeError, "boxes has values of the type <U1"),
    (lambda: pbig.pairs_between(BOXES, BOXES[:, :5]), ValueError, "b has the shape (4, 5)"),
    (lambda: pbig.pairs_between(BOXES.astype(bool), BOXES), TypeError, "numbers, such as numpy.asarray(a, dtype=float)"),
    (mesh(vertices=BOXES), ValueError, "vertices has the shape (4, 6); give (n, 3), with the xyz"),
    (mesh(vertices=VERTICES.astype(bool)), TypeError, "vertices has values of the type bool; give float32"),
    (mesh(after=VERTICES.astype(complex)), TypeError, "after has values of the type complex128; give float32"),
    (mesh(vertices=[[0, 0, 2**64]] * 8), TypeError, "vertices has values of the type object; give float32"),
    (mesh(after=VERTICES[:7]), ValueError, "after has 7 rows, vertices 8; give all vertices at the end of the step"),
    (mesh(after=VERTICES[:, :2]), ValueError, "after has the shape (8, 2)"),
    (mesh(after=1e-3), ValueError, "after is one number; give vertices, shape (n, 3); a margin is given as margin=0.001"),
    (mesh(faces=[[0, 1, 2], [2, 8, 1]]), ValueError, "faces[1, 1] is 8; the index of a vertex must be at least 0 and below 8"),
    (mesh(faces=[[0, 1, -1, 2]]), ValueError, "faces[0, 2] is -1; the index of a vertex must be at least 0 and below 8"),
    (mesh(faces=np.full((1, 3), 2**64 - 1, np.uint64)), ValueError, "faces[0, 0] is 18446744073709551615; "),
    (mesh(faces=[[0.0, 1, 2]]), TypeError, "faces has values of the type float64; give whole numbers"),
    (mesh(faces=[[True, False, True]]), TypeError, "faces has values of the type bool; give whole numbers"),
    (mesh(faces=[[0, 1]]), ValueError, "faces has the shape (1, 2); give (n, 3) or (n, 4): these are edges"),
    (mesh(edges=[[0, 1, 2]]), ValueError, "edges has the shape (1, 3); give (k, 2), with the two vertices of an edge"),
    (mesh(edges=[[0, 8]]), ValueError, "edges[0, 1] is 8; the index of a vertex must be at least 0 and below 8"),
    (mesh(margin=-0.5), ValueError, "margin is -0.5; give a finite length of at least 0"),
    (mesh(margin=np.inf), ValueError, "margin is inf; give a finite length of at least 0"),
    (mesh(margin=np.float32("nan")), ValueError, "margin is nan; give a finite length of at least 0"),
    (mesh(margin="1"), TypeError, "margin has the type str; give a number"),
    (mesh(margin=True), TypeError, "margin has the type bool; give a number"),
    (mesh(vertices="cloth.obj"), TypeError, "vertices has the type str; give an array of numbers"),
    (mesh(faces=None), TypeError, "faces has the type NoneType; give an array of numbers"),
    (mesh(faces=[[0, 1, 2], [3, 4]]), ValueError, "faces has rows of different lengths; give as many numbers in each"),
    (mesh(elements="ee,vx"), ValueError, "elements has 'vx'; give two of v (vertex), e (edge) and f (face), such as 'ee,vf'"),
    (mesh(elements=""), ValueError, "elements has ''; give two of"),
    (mesh(elements="eee"), ValueError, "elements has 'eee'; give two of"),
    (mesh(elements=["ee"]), TypeError, "elements has the type list; give a text such as 'ee,vf'"),
    (lambda: pbig.edges([[0, 1, 2**27]]), ValueError, "faces[0, 2] is 134217728; the index of a vertex must be"),
    (lambda: pbig.edges([0, 1, 2]), ValueError, "faces has the shape (3,); give (n, 3) for triangles"),
    (set_([0, 1], BOXES), ValueError, "2 ids for 4 boxes; give one id for each box"),
    (set_([0, 1, 2, -3], BOXES), ValueError, "ids[3] is -3; an id must be at least 0 and below 134217728"),
    (set_([2**27], BOXES[:1]), ValueError, "ids[0] is 134217728; an id must be at least 0 and below 134217728"),
    (set_([2**26], BOXES[:1]), ValueError, "id 67108864 is far above the 0 ids known so far; number boxes densely from 0"),
    (set_([0.0], BOXES[:1]), TypeError, "ids has values of the type float64; give whole numbers, such as int64"),
    (set_([[0]], BOXES[:1]), ValueError, "ids has the shape (1, 1); give (n,), with an id for each box"),
    (set_([0], BOXES[0]), ValueError, "boxes has the shape (6,)"),
    (lambda: pbig.BroadPhase().set_all(BOXES.astype(bool)), TypeError, "boxes has values of the type bool; give float32"),
    (lambda: pbig.BroadPhase().remove([-1]), ValueError, "ids[0] is -1"),
    (lambda: pbig.BroadPhase(margin=-1), ValueError, "margin is -1; give a finite length of at least 0"),
    (lambda: pbig.BroadPhase(margin=1e39), ValueError, "margin inf is not a finite length of at least 0"),
]


@pytest.mark.parametrize("call, kind, words", ERRORS, ids=[words for _, _, words in ERRORS])
def test_an_error_says_what_and_where(call, kind, words):
    with pytest.raises(kind) as caught:
        call()
    assert words in str(caught.value)


WARNINGS = [
    ({"vertices": np.where(np.eye(8, 3) > 0, np.nan, 0)}, "vertices has 3 rows with a NaN, the first is row 0: elements there"),
    ({"after": VERTICES - 1e39 * np.eye(8, 3, -2)}, "after has 3 rows beyond float32, the first is row 2: boxes there are infinite"),
    ({"faces": [[0, 1, 2], [7, 7, 6]]}, "faces has 1 rows that name a vertex twice, the first is row 1: they stay"),
    ({"faces": [[0, 1, 2, 0]]}, "faces has 1 rows that name a vertex twice, the first is row 0"),
]


@pytest.mark.parametrize("changes, words", WARNINGS, ids=[words for _, words in WARNINGS])
def test_a_warning_says_what_and_where_and_points_at_the_caller(changes, words):
    with pytest.warns(UserWarning) as caught:
        mesh(**changes)()
    assert [str(warning.message).startswith(words) for warning in caught] == [True]
    assert caught[0].filename == __file__


@pytest.mark.parametrize("call", [pbig.pairs, lambda boxes: pbig.pairs_between(BOXES, boxes)])
def test_boxes_that_pair_with_nothing_are_told(call):
    with pytest.warns(UserWarning, match="has 2 rows with a NaN or a minimum above its maximum, the first is row 1: ") as caught:
        call(np.array([[0, 0, 0, 1, 1, 1], [0, 0, 0, 1, np.nan, 1], [0, 9, 0, 1, 1, 1]]))
    assert len(caught) == 1 and caught[0].filename == __file__


def test_sound_and_empty_meshes_are_silent(recwarn):
    assert all(len(pairs) == 0 for pairs in mesh(faces=[])().values())
    assert all(len(pairs) == 0 for pairs in mesh(vertices=[], faces=[], margin=np.array(0.5))().values())
    assert len(pbig.pairs([])) == 0 and len(pbig.edges(np.zeros((0, 3), "U3"))) == 0 and not recwarn.list


def test_an_error_of_the_callers_own_array_stays():
    class Lazy:
        def __array__(self, *_, **__):
            raise ValueError("not a dataset")

    with pytest.raises(ValueError, match="not a dataset"):
        pbig.pairs(Lazy())


def test_more_boxes_than_there_can_be_are_refused_before_they_are_copied():
    # One row in memory.
    boxes = np.broadcast_to(np.zeros((1, 6), np.float32), (2**27 + 1, 6))
    words = "has 134217729 rows, more than 134217728; split it, and search the parts"
    for call in (pbig.pairs, lambda boxes: pbig.pairs_between(BOXES, boxes), pbig.BroadPhase().set_all):
        with pytest.raises(ValueError, match=words):
            call(boxes)
    with pytest.raises(ValueError, match="vertices " + words):
        pbig.mesh_pairs(boxes[:, :3], FACES)


@pytest.mark.skipif("PBIG_LARGE_TESTS" not in os.environ, reason="needs 9 GB of memory; set PBIG_LARGE_TESTS to run it")
def test_more_pairs_than_there_can_be_are_an_error():
    with pytest.raises(ValueError, match="more than 268435456 overlapping pairs; split the set"):
        pbig.pairs(np.zeros((24_000, 6), np.float32))


def test_a_broad_phase_can_be_used_after_an_error():
    broad_phase = pbig.BroadPhase()
    with pytest.raises(ValueError, match="id 67108864"):
        broad_phase.set([0, 1, 2**26, 3], BOXES)
    assert broad_phase.update()[0].tolist() == [[0, 1]]
