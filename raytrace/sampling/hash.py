"""Counter-based random bits: a bijective 32-bit integer hash (Wellons 2018, lowbias32), in kernels and of arrays."""

import numpy as np
import numpy.typing as npt

from ..kernel.jit import inline
from ..types import UInt32s


def _lowbias32(x):
    """The hash of one value or an array; results are cast back, as whole numbers are 64 bits wide in kernels."""
    x = np.uint32(x)
    x = np.uint32(x ^ (x >> np.uint32(16)))
    x = np.uint32(x * np.uint32(0x7FEB352D))
    x = np.uint32(x ^ (x >> np.uint32(15)))
    x = np.uint32(x * np.uint32(0x846CA68B))
    return np.uint32(x ^ (x >> np.uint32(16)))


mix = inline(_lowbias32)  # of one value, in kernels


def mix_array(values: npt.ArrayLike) -> UInt32s:
    """Bijective hash of whole numbers below 2^32, of one dimension or more, so that counters become random bits."""
    return _lowbias32(np.asarray(values, np.uint32))


def seed_key(seed: int) -> np.uint32:
    """A 32-bit key from a seed of up to 64 bits."""
    low, high = mix_array([seed & 0xFFFFFFFF]), np.uint32(seed >> 32)
    return mix_array(low ^ high)[0]
