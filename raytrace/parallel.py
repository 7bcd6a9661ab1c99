"""Blocks of work on threads: progress, Ctrl-C and results that don't depend on the number of threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice

from .errors import OptionError

MAX_THREADS = 4096


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
    """Call `work(start, stop)` over [0, count) in blocks, on `threads` threads.

    `work` must release the GIL to gain anything and write only its own rows. `progress` is told, on this thread,
    how many items each finished block had. An exception or Ctrl-C drops the blocks that have not begun. Only two blocks
    a thread are handed over at a time, as waiting takes longer the more there are to wait for.
    """
    with ThreadPoolExecutor(threads) as pool:
        pending: dict[Future[None], int] = {}
        starts = iter(range(0, count, block))
        try:
            while True:
                for start in islice(starts, 2 * threads - len(pending)):
                    size = min(block, count - start)
                    pending[pool.submit(work, start, start + size)] = size
                if not pending:
                    return
                done, _ = wait(pending, timeout=0.1, return_when=FIRST_COMPLETED)
                for future in done:
                    future.result()
                    size = pending.pop(future)
                    if progress:
                        progress(size)
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
