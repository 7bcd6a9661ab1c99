"""Arrays for kernels and Embree: aligned, multiplied without BLAS, sorted by counting.

OpenBLAS multiplies a few thousand rows on threads that go on spinning for some thirty milliseconds afterwards, on
cores that rays are traced on meanwhile: bakes take up to twice as long.
"""

import ctypes
import math
import os
from typing import Any

import numpy as np
import numpy.typing as npt

from ..types import AnyFloats, Float64s, Int32s, Int64s
from .jit import kernel


def product(rows: Float64s, matrix: AnyFloats) -> Float64s:
    """rows (n, k) · matrix (k,) or (k, m): (n,) or (n, m)."""
    return np.asarray(np.einsum("nk,k...->n...", rows, matrix))


def aligned(shape: tuple[int, ...], dtype: npt.DTypeLike, zeroed: bool = True) -> npt.NDArray[Any]:
    """Array of zeros, or of anything, that starts on a 64-byte boundary and owns 16 spare bytes, as Embree wants."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    raw = (np.zeros if zeroed else np.empty)(size + 80, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + size].view(dtype).reshape(shape)


def give_memory_back() -> None:
    """Return the pages of freed arrays to the system, which the C library keeps for later ones, where it can."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if os.name == "posix" else None
    if trim:
        trim(0)


def counting_sort(keys: Int32s | Int64s, count: int) -> tuple[Int64s, Int64s]:
    """Places in the flattened keys, whole numbers below `count`, by key, stable; negative ones are left out.

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
