"""Random bits inside kernels."""

from __future__ import annotations

import numpy as np

from .jit import inline


@inline
def mix(x):
    """`raytrace.sampling.mix` of one value."""
    x = np.uint32(x)
    x = np.uint32(x ^ (x >> np.uint32(16)))
    x = np.uint32(x * np.uint32(0x7FEB352D))
    x = np.uint32(x ^ (x >> np.uint32(15)))
    x = np.uint32(x * np.uint32(0x846CA68B))
    return np.uint32(x ^ (x >> np.uint32(16)))
