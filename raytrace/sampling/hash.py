"""Counter-based random bits: an integer hash (Wellons 2018, lowbias32), in kernels and over arrays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..kernel.jit import inline

UInts = npt.NDArray[np.uint32]


@inline
def mix(x):
    """`mix_array` of one value, in kernels."""
    x = np.uint32(x)
    x = np.uint32(x ^ (x >> np.uint32(16)))
    x = np.uint32(x * np.uint32(0x7FEB352D))
    x = np.uint32(x ^ (x >> np.uint32(15)))
    x = np.uint32(x * np.uint32(0x846CA68B))
    return np.uint32(x ^ (x >> np.uint32(16)))


def mix_array(values: npt.ArrayLike) -> UInts:
    """Bijective 32-bit integer hash, so that counters become random bits (Wellons 2018, lowbias32)."""
    x = np.array(values, np.uint32)
    x ^= x >> np.uint32(16)
    x *= np.uint32(0x7FEB352D)
    x ^= x >> np.uint32(15)
    x *= np.uint32(0x846CA68B)
    x ^= x >> np.uint32(16)
    return x


def seed_key(seed: int) -> np.uint32:
    """A 32-bit key from a seed of up to 64 bits."""
    low, high = mix_array([seed & 0xFFFFFFFF]), np.uint32(seed >> 32)
    return mix_array(low ^ high)[0]
