"""The cores that tests run on: one for each process of pytest-xdist, all for tests of several threads."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

CORES = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set[int]()  # none where none can be chosen


def keep_one(number: int) -> None:
    """Run on one core from now on: bakes have as many threads as cores, and those of two processes would take turns."""
    if CORES:
        os.sched_setaffinity(0, {sorted(CORES)[number % len(CORES)]})


@contextmanager
def every_core() -> Iterator[None]:
    """Run on all cores."""
    if not CORES:
        yield
        return
    own = os.sched_getaffinity(0)
    os.sched_setaffinity(0, CORES)
    try:
        yield
    finally:
        os.sched_setaffinity(0, own)
