"""`pairs` and `pairs_between` find what a test of all pairs finds."""

import brute
import numpy as np
import pytest

import pbig


def random_boxes(count, seed, size=0.12):
    random = np.random.default_rng(seed)
    low = random.random((count, 3))
    return np.hstack([low, low + size * random.random((count, 3))])


def whole_boxes(count, seed):
    """Returns boxes with small whole numbers: many touch, are points, equal, or inverted."""
    return np.random.default_rng(seed).integers(0, 6, (count, 6)).astype(float)


def wild_boxes(count, seed):
    """Returns boxes of every size, some infinite, some with a NaN."""
    random = np.random.default_rng(seed)
    low = random.normal(size=(count, 3)) * 10.0 ** random.integers(-3, 30, (count, 1))
    boxes = np.hstack([low, low + np.abs(low) * random.random((count, 3))])
    boxes[:: 7, 0], boxes[3 :: 11, 4], boxes[5 :: 13, 2] = -np.inf, np.inf, np.nan
    return boxes


SCENES = {
    "random": random_boxes(900, 1),
    "few": random_boxes(60, 2, 0.7),
    "touching": whole_boxes(400, 3),
    "wild": wild_boxes(900, 4),
    "points": np.tile(np.random.default_rng(5).integers(0, 5, (300, 3)), 2).astype(float),
    "equal": np.tile([[0.1, 0.1, 0.1, 0.3, 0.3, 0.3]], (250, 1)),
    "invalid": np.full((300, 6), np.nan),
    "one": np.zeros((1, 6)),
    "empty": np.zeros((0, 6)),
}

LAYOUTS = {
    "float64": lambda boxes: boxes,
    "float32": lambda boxes: boxes.astype(np.float32),
    "corners": lambda boxes: boxes.reshape(-1, 2, 3),
    "Fortran": lambda boxes: np.asfortranarray(boxes, dtype=np.float32),
    "Fortran float64": np.asfortranarray,
    "columns": lambda boxes: np.repeat(boxes.astype(np.float32), 2, axis=1)[:, ::2],
    "backward": lambda boxes: np.ascontiguousarray(boxes[::-1], dtype=np.float32)[::-1],
    "other bytes": lambda boxes: boxes.astype(">f4"),
    "unaligned": lambda boxes: unaligned(boxes.astype(np.float32)),
    "read-only": lambda boxes: read_only(boxes.astype(np.float32)),
    "list": lambda boxes: boxes.tolist() or boxes,
}


def unaligned(boxes):
    bytes_ = np.zeros(boxes.nbytes + 1, np.uint8)
    array = bytes_[1:].view(np.float32).reshape(boxes.shape)
    array[...] = boxes
    return array


def read_only(boxes):
    boxes.flags.writeable = False
    return boxes


def check(found, wanted):
    assert found.dtype == np.uint32 and found.flags.c_contiguous and found.flags.writeable
    assert found.shape == (len(wanted), 2)
    assert found.tolist() == wanted


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.filterwarnings("ignore:overflow encountered in cast")
def test_pairs_are_those_of_a_test_of_all(scene, layout):
    boxes = LAYOUTS[layout](SCENES[scene])
    check(pbig.pairs(boxes), brute.pairs(np.array(boxes)))


@pytest.mark.parametrize("first", SCENES)
@pytest.mark.parametrize("second", ["random", "touching", "wild", "empty"])
def test_pairs_between_are_those_of_a_test_of_all(first, second):
    a, b = SCENES[first], SCENES[second].astype(np.float32)
    check(pbig.pairs_between(a, b), brute.between(a, b))
    check(pbig.pairs_between(b, a), brute.between(b, a))


def test_scenes_have_pairs_and_gaps():
    counts = {name: len(pbig.pairs(boxes)) for name, boxes in SCENES.items()}
    assert all(counts[name] > 100 for name in ("random", "few", "touching", "wild", "points", "equal")), counts
    assert counts["points"] < 300 * 299 / 2


def test_many_boxes_are_searched_by_several_threads():
    boxes = random_boxes(17_000, 6, 0.03)
    check(pbig.pairs(boxes), brute.pairs(boxes))


def test_touching_boxes_overlap_and_the_smallest_gap_parts_them():
    boxes = np.array([[0, 0, 0, 1, 1, 1], [1, 1, 1, 2, 2, 2]], np.float32)
    assert pbig.pairs(boxes).tolist() == [[0, 1]]
    boxes[1, 0] = np.nextafter(np.float32(1), np.float32(2))
    assert pbig.pairs(boxes).tolist() == []


def test_float64_is_rounded_outward():
    # float32 has no number between 1 and 1 + bit. The nearest ones to these ends are 1 and 1 + bit.
    bit = 2.0**-23
    boxes = np.array([[0, 0, 0, 1 + 0.4 * bit, 1, 1], [1 + 0.6 * bit, 0, 0, 2, 1, 1]])
    assert pbig.pairs(boxes).tolist() == pbig.pairs(-boxes[:, [3, 4, 5, 0, 1, 2]]).tolist() == [[0, 1]]
    assert pbig.pairs(boxes.astype(np.float32)).tolist() == []


@pytest.mark.parametrize("kind", ["i1", "u1", ">i2", "u4", "i8", "u8"])
def test_whole_numbers_are_read_as_float64(kind):
    places = SCENES["touching"]
    boxes, wanted = places.astype(kind), brute.pairs(places)
    check(pbig.pairs(boxes), wanted)
    check(pbig.pairs(boxes.tolist()), wanted)
    check(pbig.pairs_between(boxes, places / 2), brute.between(places, places / 2))
    broad_phase = pbig.BroadPhase()
    broad_phase.set_all(boxes[:-1])
    broad_phase.set([len(boxes) - 1], boxes[-1:])
    check(broad_phase.update()[0], wanted)


def test_whole_numbers_are_rounded_outward():
    # float32 has no odd numbers here. The nearest ones to the first two ends are 2**24 and 2**24 + 2.
    boxes = [[0, 0, 0, 2**24 + 1, 1, 1], [2**24 + 2, 0, 0, 2**24 + 4, 1, 1]]
    assert pbig.pairs(boxes).tolist() == [[0, 1]]
    assert pbig.pairs(np.array(boxes, np.float32)).tolist() == []


def test_a_box_that_is_inverted_in_float64_alone_has_no_pairs():
    boxes = np.array([[0, 0, 0, 2, 2, 2], [1 + 1e-12, 1, 1, 1, 1, 1]])
    assert pbig.pairs(boxes).tolist() == []
    assert pbig.pairs(boxes.astype(np.float32)).tolist() == [[0, 1]]


def test_float32_is_read_in_place():
    boxes = random_boxes(300, 7).astype(np.float32)
    before = boxes.copy()
    assert np.shares_memory(pbig._checks.boxes("boxes", boxes.reshape(-1, 2, 3)), boxes)
    pbig.pairs(boxes)
    assert (boxes == before).all()
