"""Blocks of work on threads: progress, Ctrl-C and results that don't depend on the number of threads.

Not concurrent.futures, whose pool fails where the system grants fewer threads than asked for: here the calling thread
works too, so one is enough, and an interrupt waits for no more than the blocks at work (docs/reliability.md).
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from queue import Empty, SimpleQueue

from ..errors import OptionError

MAX_THREADS = 4096
_within = threading.local()  # its `blocks`: whether this thread is at work for `run_blocks`


def thread_count(threads: int | None) -> int:
    """`threads`, or the number of cores this process may use for None.

    Raises:
        OptionError: not a whole number from 1 to 4096.
    """
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, int) or not 1 <= threads <= MAX_THREADS:
        raise OptionError("threads", f"a whole number from 1 to {MAX_THREADS}", threads)
    return threads


def run_blocks(
    count: int,
    block: int,
    work: Callable[[int, int], None],
    threads: int,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Call `work(start, stop)` over [0, count) in blocks, on this thread and others: `threads`, if so many are granted.

    `work` must release the GIL to gain anything and write only its own rows. `progress` is called, on this thread,
    with the number of items of each finished block. An exception or Ctrl-C drops the blocks that have not begun.
    A call within `work` stays on its thread: the others are at work already.
    """
    threads = min(threads, -(-count // block), 1 if getattr(_within, "blocks", False) else MAX_THREADS)
    if threads <= 1:  # the bake of a small mesh has dozens of these; a queue would take as long as their work
        for start in range(0, count, block):
            stop = min(start + block, count)
            work(start, stop)
            if progress:
                progress(stop - start)
        return
    starts = iter(range(0, count, block))
    finished: SimpleQueue[int | BaseException] = SimpleQueue()
    taking, over = threading.Lock(), threading.Event()

    def work_one() -> bool:
        with taking:
            start = next(starts, None)
        if start is None or over.is_set():
            return False
        stop = min(start + block, count)
        _within.blocks = True
        try:
            work(start, stop)
        finally:
            _within.blocks = False
        finished.put(stop - start)
        return True

    def work_off() -> None:
        try:
            while work_one():
                pass
        except BaseException as failure:
            finished.put(failure)

    workers: list[threading.Thread] = []
    try:
        _start(workers, work_off, threads - 1)
        left, busy = count, True
        while left > 0:
            busy = busy and work_one()
            for size in _taken(finished, wait=not busy):
                if isinstance(size, BaseException):
                    raise size
                left -= size
                if progress:
                    progress(size)
    finally:
        over.set()
        for worker in workers:
            worker.join()


def _taken(finished: SimpleQueue[int | BaseException], wait: bool) -> Iterator[int | BaseException]:
    """All that is queued; if nothing is, and `wait`, what comes within a tenth of a second, for Ctrl-C to get in."""
    try:
        yield finished.get(wait, 0.1)
        while True:
            yield finished.get_nowait()
    except Empty:
        return


def _start(workers: list[threading.Thread], work: Callable[[], None], most: int) -> None:
    """Add up to `most` running threads to `workers`; a system short of memory or of processes grants fewer."""
    for _ in range(most):
        worker = threading.Thread(target=work)
        try:
            worker.start()
        except RuntimeError:
            return
        workers.append(worker)
