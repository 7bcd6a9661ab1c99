"""Blocks on threads: all of them, once, stopped when asked to."""

import gc
import os
import threading
import time
import warnings
import weakref

import numpy as np
import pytest

from obscurance.raytrace import OptionError
from obscurance.raytrace.system import threads as threads_module
from obscurance.raytrace.system.threads import run_blocks, shares, thread_count


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


@pytest.mark.parametrize("granted", [0, 1])
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
    threads_module._team.__init__()  # as in a process that is forked
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


def test_an_interrupt_ends_what_a_call_within_a_block_does_on_another_thread():
    main, within = threading.get_ident(), []

    def work(_start, _stop):
        if threading.get_ident() != main:
            run_blocks(10_000, 1, lambda start, _: (within.append(start), time.sleep(0.005)), 2)
        while not within:
            time.sleep(0.001)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_blocks(2, 1, work, 2)
    assert len(within) < 1000


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


@pytest.mark.parametrize("most", [1, 16])
@pytest.mark.parametrize("threads", [1, 3, 16])
@pytest.mark.parametrize("count", [0, 1, 7, 64, 10_001])
def test_shares_cover_everything_in_order_and_shorten_towards_the_end(count, threads, most):
    parts = list(shares(count, 5, threads, most))
    assert [start for start, _ in parts] == [0, *(stop for _, stop in parts)][: len(parts)]
    assert (parts[-1][1] if parts else 0) == count
    sizes = [stop - start for start, stop in parts]
    assert all(size % 5 == 0 and size <= 5 * most for size in sizes[:-1])
    assert sizes == sorted(sizes, reverse=True)
    assert all(size <= max((count - start) / (2 * threads), 5) for (start, _), size in zip(parts, sizes, strict=True))


def pause(_start, _stop):
    time.sleep(0.0005)


def test_threads_are_kept_for_later_calls():
    run_blocks(64, 1, pause, 4)
    before = threading.active_count()
    for _ in range(30):
        run_blocks(16, 1, pause, 4)
    assert threading.active_count() == before


def test_calls_from_several_threads_at_once_each_have_help():
    busy, most, lock = 0, [], threading.Lock()

    def work(_start, _stop):
        nonlocal busy
        with lock:
            busy += 1
            most.append(busy)
        time.sleep(0.002)
        with lock:
            busy -= 1

    callers = [threading.Thread(target=run_blocks, args=(100, 1, work, 2)) for _ in range(3)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert len(most) == 300
    assert max(most) == 6


@pytest.mark.parametrize("fails", [False, True])
def test_what_the_work_refers_to_is_let_go_with_the_call(fails):
    held = np.zeros(10)
    gone = weakref.ref(held)

    def call(held):
        def work(start, _stop):
            held[0] += 1
            time.sleep(0.001)
            if fails and start > 20:
                raise ZeroDivisionError

        try:
            run_blocks(50, 1, work, 8)
        except ZeroDivisionError:
            assert fails

    call(held)
    del held
    deadline = time.monotonic() + 5
    while gone() is not None and time.monotonic() < deadline:
        gc.collect()
        time.sleep(0.001)
    assert gone() is None


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_has_threads_of_its_own():
    run_blocks(64, 1, pause, 4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of later Pythons, about forks beside threads
        child = os.fork()
    if not child:
        seen = set()

        def work(_start, _stop):
            time.sleep(0.002)
            seen.add(threading.get_ident())

        run_blocks(64, 1, work, 2)
        os._exit(len(seen))
    deadline, status = time.monotonic() + 20, (0, 0)
    while not status[0] and time.monotonic() < deadline:
        time.sleep(0.01)
        status = os.waitpid(child, os.WNOHANG)
    if not status[0]:
        os.kill(child, 9)
        os.waitpid(child, 0)
    assert status[0]
    assert os.waitstatus_to_exitcode(status[1]) == 2


def test_an_interrupt_while_threads_are_asked_for_help_is_that_interrupt(monkeypatch):
    def interrupted(call, _):
        call.helping = 1  # a thread that has come already
        threading.Timer(0.1, call.help).start()
        raise KeyboardInterrupt

    monkeypatch.setattr(threads_module._team, "ask", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_blocks(100, 1, lambda start, stop: None, 2)
