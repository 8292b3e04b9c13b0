"""Python threads go on while one searches, and forked processes can search."""

import multiprocessing
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import pbig


def boxes(count, seed):
    low = np.random.default_rng(seed).random((count, 3)).astype(np.float32)
    return np.hstack([low, low + np.float32(0.8 * count ** (-1 / 3))])


def test_two_threads_search_at_once():
    both = [boxes(30_000, 1), boxes(30_000, 2)]
    wanted = [pbig.pairs(one) for one in both]
    assert all(len(pairs) > 10_000 for pairs in wanted)
    with ThreadPoolExecutor(2) as pool:
        for _ in range(10):
            found = pool.map(pbig.pairs, both)
            assert all((pairs == same).all() for pairs, same in zip(found, wanted))


def test_threads_take_turns_with_one_broad_phase():
    broad_phase, all_boxes = pbig.BroadPhase(), boxes(2000, 3)

    def use(thread):
        ids = np.arange(thread, 2000, 4)
        for _ in range(50):
            broad_phase.set(ids, all_boxes[ids])
            broad_phase.update()

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(use, range(4)))
    assert (broad_phase.pairs() == pbig.pairs(all_boxes)).all()


def longest_wait(work):
    """Returns the longest time for which this thread stood still while another worked, as a share of the work's time."""
    thread = threading.Thread(target=work)
    begin = last = time.perf_counter()
    longest = 0.0
    thread.start()
    while thread.is_alive():
        now = time.perf_counter()
        longest, last = max(longest, now - last), now
    return longest / (time.perf_counter() - begin)


def update(many):
    broad_phase = pbig.BroadPhase()
    broad_phase.set_all(many)
    broad_phase.update()


@pytest.mark.parametrize("search", [pbig.pairs, update])
def test_other_threads_go_on(search):
    many = boxes(300_000, 4)
    # A busy machine may let this thread stand still, but not each time.
    assert min(longest_wait(lambda: search(many)) for _ in range(10)) < 0.3


def search_in_child(many, wanted):
    assert (pbig.pairs(many) == wanted).all()
    broad_phase = pbig.BroadPhase()
    broad_phase.set_all(many)
    assert (broad_phase.update()[0] == wanted).all()


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="this system has no fork")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_can_search():
    many = boxes(20_000, 5)
    child = multiprocessing.get_context("fork").Process(target=search_in_child, args=(many, pbig.pairs(many)))
    child.start()
    child.join(60)
    is_done = child.exitcode is not None
    child.kill()
    assert is_done and child.exitcode == 0
