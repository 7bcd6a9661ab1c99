"""Stable counting sort of small whole numbers, such as indices of vertices or cells."""

import numpy as np

from ..types import AnyInts, Int64s
from .jit import kernel


def counting_sort(keys: AnyInts, count: int) -> tuple[Int64s, Int64s]:
    """Sort places by their keys.

    Args: keys: C-contiguous, any shape, below `count`; negative ones are left out.
    Returns: places in the flattened keys (k,), int64, by key, ascending among equal keys; and starts (count + 1,),
        int64: places[starts[i] : starts[i + 1]] have key i.
    """
    flat, starts = keys.reshape(-1), np.zeros(count + 2, np.int64)
    _count(flat, starts)
    places = np.empty(starts[-1], np.int64)
    _place(flat, starts, places)
    return places, starts[:-1]


@kernel
def _count(keys, starts):
    """Set starts[i + 1] to where key i begins."""
    for k in range(len(keys)):
        if keys[k] >= 0:
            starts[keys[k] + 2] += 1
    for i in range(2, len(starts)):
        starts[i] += starts[i - 1]


@kernel
def _place(keys, starts, places):
    """Fill in the places, which moves starts[i + 1] to where key i ends."""
    for k in range(len(keys)):
        if keys[k] >= 0:
            row = keys[k] + 1
            places[starts[row]] = k
            starts[row] += 1
