"""`BroadPhase` reports what changes between the pairs of a test of all."""

import brute
import numpy as np
import pytest

import pbig


def sets(update):
    added, removed = update
    assert added.dtype == removed.dtype == np.uint32
    assert added.shape[1:] == removed.shape[1:] == (2,)
    for pairs in (added, removed):
        assert pairs.tolist() == sorted(pairs.tolist()) and (pairs[:, 0] < pairs[:, 1]).all()
    return ({tuple(pair) for pair in pairs.tolist()} for pairs in (added, removed))


def pairs_of(boxes):
    """Returns the pairs of boxes by id."""
    ids = sorted(boxes)
    rows = np.array([boxes[id_] for id_ in ids]).reshape(-1, 6)
    return {(ids[i], ids[j]) for i, j in brute.pairs(rows)}


def random_box(random):
    low = random.integers(0, 12, 3).astype(float)
    box = np.concatenate([low, low + random.integers(0, 3, 3)])
    if random.random() < 0.1:
        box[random.integers(0, 6)] = np.nan
    return box


class Model:
    """A broad phase that tests all pairs."""

    def __init__(self):
        self.boxes, self.pairs = {}, set()

    def set(self, ids, boxes):
        self.boxes.update(zip(ids, boxes))

    def remove(self, ids):
        found = [id_ for id_ in set(ids) if self.boxes.pop(id_, None) is not None]
        self.pairs = {pair for pair in self.pairs if not set(pair) & set(found)}
        return len(found)

    def update(self):
        before, self.pairs = self.pairs, pairs_of(self.boxes)
        return self.pairs - before, before - self.pairs


@pytest.mark.parametrize("seed", range(12))
def test_a_history_follows_a_test_of_all(seed):
    random = np.random.default_rng(seed)
    broad_phase, model = pbig.BroadPhase(), Model()
    ids = 40 if seed % 2 else 400
    for _ in range(25):
        for _ in range(random.integers(1, 4)):
            some = random.integers(0, ids, random.integers(0, ids // random.choice([1, 10])))
            action = random.choice(["set", "set", "remove", "all"])
            if action == "remove":
                assert broad_phase.remove(some) == model.remove(some.tolist())
                continue
            if action == "all":
                some = np.arange(random.integers(0, ids))
                model.remove(set(model.boxes) - set(some.tolist()))
            boxes = np.array([random_box(random) for _ in some]).reshape(-1, 6)
            model.set(some.tolist(), boxes)
            broad_phase.set_all(boxes) if action == "all" else broad_phase.set(some, boxes)
            assert len(broad_phase) == len(model.boxes)
            assert {tuple(pair) for pair in broad_phase.pairs().tolist()} == model.pairs
        added, removed = sets(broad_phase.update())
        assert (added, removed) == model.update()
        pairs = broad_phase.pairs()
        assert pairs.dtype == np.uint32 and pairs.shape == (len(pairs), 2)
        assert pairs.tolist() == sorted(map(list, model.pairs))


def test_many_boxes_are_set_by_several_threads():
    random = np.random.default_rng(1)
    low = random.random((20_000, 3))
    boxes = np.hstack([low, low + 0.02])
    broad_phase = pbig.BroadPhase()
    for _ in range(3):
        broad_phase.set_all(boxes)
        broad_phase.update()
        assert (broad_phase.pairs() == pbig.pairs(boxes)).all()
        boxes += random.normal(size=(20_000, 1)) * 0.01


def test_a_margin_reports_pairs_early():
    boxes = np.array([[0, 0, 0, 1, 1, 1], [1.5, 0, 0, 2, 1, 1]])
    broad_phase = pbig.BroadPhase(margin=0.25)
    broad_phase.set_all(boxes)
    assert broad_phase.update()[0].tolist() == [[0, 1]]
    # Within the stored box nothing changes.
    broad_phase.set([1], boxes[1:] + 0.2)
    added, removed = broad_phase.update()
    assert len(added) == len(removed) == 0
    broad_phase.set([1], boxes[1:] + 2)
    assert broad_phase.update()[1].tolist() == [[0, 1]]


def test_pairs_of_removed_boxes_are_gone_and_those_of_nan_boxes_are_reported():
    boxes = np.zeros((4, 6))
    broad_phase = pbig.BroadPhase()
    broad_phase.set_all(boxes)
    broad_phase.update()
    assert broad_phase.remove([3, 3, 9]) == 1 and len(broad_phase) == 3
    assert broad_phase.pairs().tolist() == [[0, 1], [0, 2], [1, 2]]
    broad_phase.set([2], boxes[:1] * np.nan)
    added, removed = broad_phase.update()
    assert added.tolist() == [] and removed.tolist() == [[0, 2], [1, 2]]


def test_no_ids_change_nothing():
    broad_phase = pbig.BroadPhase()
    broad_phase.set([], np.zeros((0, 6)))
    assert broad_phase.remove([]) == 0 and len(broad_phase) == 0
    assert [pairs.shape for pairs in broad_phase.update()] == [(0, 2), (0, 2)]
