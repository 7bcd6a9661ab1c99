"""Stable counting sort of small whole numbers, such as indices of vertices or cells."""

import numpy as np

from ..types import Int32s, Int64s
from .jit import kernel


def counting_sort(keys: Int32s | Int64s, count: int) -> tuple[Int64s, Int64s]:
    """Places in the flattened keys, below `count`, by key, ascending among equal keys; negative ones are left out.

    Returns: places int64 (k,), and starts int64 (count + 1,): places[starts[i] : starts[i + 1]] have key i.
    """
    starts = np.zeros(count + 2, np.int64)
    places = np.empty(keys.size, np.int64)
    _sort(keys.reshape(-1), starts, places)
    return places[: starts[-1]], starts[:-1]


@kernel
def _sort(keys: Int32s | Int64s, starts: Int64s, places: Int64s) -> None:
    """Write `counting_sort`. Args: starts: zeros (count + 2,)."""
    for k in range(len(keys)):
        if keys[k] >= 0:
            starts[keys[k] + 2] += 1
    for i in range(2, len(starts)):
        starts[i] += starts[i - 1]  # starts[i + 1] is where key i begins
    for k in range(len(keys)):
        if keys[k] >= 0:
            row = keys[k] + 1
            places[starts[row]] = k
            starts[row] += 1  # and becomes where it ends
