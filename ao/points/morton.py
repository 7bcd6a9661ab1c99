"""Morton order (Z-order curve): neighbours in space become neighbours in memory.

Morton 1966, A computer oriented geodetic data base and a new technique in file sequencing.
"""

from __future__ import annotations

import numpy as np

from raytrace.kernel.jit import inline, kernel
from raytrace.mesh.placement import NEAR
from raytrace.types import AnyFloats, Float64s, Int64s, UInt32s

_COARSE, _FINE = 10, 21  # bits an axis


def morton_order(points: AnyFloats) -> Int64s:
    """Rows of `points` (n, 3), finite, by 2^10 cells a side of their bounding cube; stable."""
    if not len(points):
        return np.zeros(0, np.int64)
    low, high = (np.array([bound(column) for column in points.T], np.float64) for bound in (np.min, np.max))
    return np.argsort(morton_codes(points, low, high), kind="stable")


def morton_codes(points: AnyFloats, low: Float64s, high: Float64s) -> UInt32s:
    """Keys (n,) of `morton_order`. Args: low, high: (3,), bounds of all points, clipped to `NEAR`."""
    low, high = np.clip(low, -NEAR, NEAR), np.clip(high, -NEAR, NEAR)
    extent = float((high - low).max())
    codes = np.empty(len(points), np.uint32)
    _codes(points, low, (2.0**_COARSE - 1.0) / extent if extent > 0 else 0.0, codes)
    return codes


def fine_morton_order(points: AnyFloats) -> Int64s:
    """`morton_order` of points in [−1, 1], with 2^21 cells a side of that cube."""
    codes = np.empty(len(points), np.uint64)
    _codes(points[:, ::-1], np.full(3, -1.0), 2.0 ** (_FINE - 1), codes)
    return np.argsort(codes, kind="stable")


@inline
def _interleaved(x):
    """The 21 lowest bits of `x`, each followed by two zeros."""
    x = (x | (x << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
    x = (x | (x << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
    x = (x | (x << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    x = (x | (x << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (x | (x << np.uint64(2))) & np.uint64(0x1249249249249249)


@kernel
def _codes(points, low, scale, codes):
    for i in range(len(points)):
        code = np.uint64(0)
        for axis in range(3):
            cell = min(max((points[i, axis] - low[axis]) * scale, 0.0), 2.0**_FINE - 1.0)
            code = (code << np.uint64(1)) | _interleaved(np.uint64(cell))
        codes[i] = code
