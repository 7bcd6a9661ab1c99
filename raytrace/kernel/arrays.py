"""Arrays for kernels and Embree: aligned, multiplied without BLAS.

OpenBLAS multiplies a few thousand rows on threads that go on spinning for some thirty milliseconds afterwards, on
cores that rays are traced on meanwhile: bakes take up to twice as long.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ..types import AnyFloats, Float64s


def product(rows: Float64s, matrix: AnyFloats) -> Float64s:
    """rows (n, k) · matrix (k,) or (k, m): (n,) or (n, m)."""
    return np.asarray(np.einsum("nk,k...->n...", rows, matrix))


def aligned(shape: tuple[int, ...], dtype: npt.DTypeLike, zeroed: bool = True) -> npt.NDArray[Any]:
    """Array of zeros, or of anything, that starts on a 64-byte boundary and owns 16 spare bytes, as Embree wants."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    raw = (np.zeros if zeroed else np.empty)(size + 80, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + size].view(dtype).reshape(shape)
