"""Blocks on threads: all of them, once, stopped when asked to."""

import threading
import time

import numpy as np
import pytest

from raytrace import OptionError
from raytrace.system.threads import run_blocks, thread_count


@pytest.mark.parametrize(("count", "block"), [(0, 4), (1, 4), (4, 4), (10, 3), (100_000, 7)])
def test_every_item_is_worked_on_once(count, block):
    seen, finished = np.zeros(count, int), []

    def work(start, stop):
        seen[start:stop] += 1

    run_blocks(count, block, work, 3, finished.append)
    assert (seen == 1).all()
    assert sum(finished) == count


def test_an_exception_drops_what_has_not_begun():
    begun = []

    def work(start, _stop):
        begun.append(start)
        time.sleep(0.01)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run_blocks(1000, 1, work, 2)
    assert len(begun) < 100


@pytest.mark.parametrize("granted", [0, 2])
def test_a_system_that_grants_few_threads_gets_all_work_done(granted, monkeypatch):
    start, begun, seen = threading.Thread.start, [], np.zeros(1000, int)

    def start_some(thread):
        if len(begun) == granted:
            raise RuntimeError("can't start new thread")
        begun.append(thread)
        start(thread)

    def work(first, last):
        seen[first:last] += 1

    monkeypatch.setattr(threading.Thread, "start", start_some)
    run_blocks(1000, 3, work, 64)
    assert (seen == 1).all()
    assert len(begun) == granted


def test_progress_counts_all_threads_blocks_as_they_finish():
    finished, begun = [], []

    def work(start, _stop):
        begun.append(start)
        time.sleep(0.002)

    run_blocks(200, 1, work, 4, lambda _size: finished.append(len(begun)))
    assert len(finished) == 200
    assert max(np.array(finished) - np.arange(200)) < 20


def test_a_failure_on_another_thread_is_raised_here():
    main = threading.get_ident()

    def work(_start, _stop):
        time.sleep(0.002)
        if threading.get_ident() != main:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run_blocks(1000, 1, work, 2)


def test_an_interrupt_in_the_main_thread_stops_the_work():
    begun = []

    def work(start, _stop):
        begun.append(threading.get_ident())
        time.sleep(0.005)

    def interrupt(_items):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_blocks(10_000, 1, work, 2, interrupt)
    assert len(begun) < 1000


@pytest.mark.parametrize("threads", [0, -1, 1.5, True, 100_000, "2"])
def test_thread_counts_are_whole_and_positive(threads):
    with pytest.raises(OptionError, match="threads: expected a whole number from 1 to 4096"):
        thread_count(threads)


def test_a_call_within_a_block_stays_on_its_thread():
    seen = []

    def work(start, stop):
        own = threading.get_ident()
        run_blocks(8, 1, lambda first, last: seen.append((own, threading.get_ident())), 4)

    run_blocks(3, 1, work, 2)
    assert len(seen) == 24
    assert all(own == inner for own, inner in seen)
    others = set()
    run_blocks(64, 1, lambda first, last: (time.sleep(0.001), others.add(threading.get_ident())), 2)
    assert len(others) == 2
