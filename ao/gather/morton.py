"""An order of points in which neighbours in space are neighbours in memory (Morton 1966)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.kernel.jit import inline, kernel

_LEVELS = 10  # cells a side: 2^10


def morton_order(points: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.int64]:
    """Rows of `points` (n, 3), finite, along the Z-shaped curve through their bounding cube; ties keep their order."""
    if not len(points):
        return np.zeros(0, np.int64)
    low = np.array([column.min() for column in points.T], np.float64)
    extent = max(float(column.max() - least) for column, least in zip(points.T, low, strict=True))
    codes = np.empty(len(points), np.uint32)
    _codes(points, low, (2.0**_LEVELS - 1.0) / extent if extent > 0 else 0.0, codes)
    return np.argsort(codes, kind="stable")


@inline
def _spread(x):
    """The ten lowest bits of `x`, each followed by two zeros."""
    x = (x | (x << np.uint32(16))) & np.uint32(0x030000FF)
    x = (x | (x << np.uint32(8))) & np.uint32(0x0300F00F)
    x = (x | (x << np.uint32(4))) & np.uint32(0x030C30C3)
    return (x | (x << np.uint32(2))) & np.uint32(0x09249249)


@kernel
def _codes(points, low, scale, codes):
    for i in range(len(points)):
        code = np.uint32(0)
        for axis in range(3):
            code = (code << np.uint32(1)) | _spread(np.uint32((points[i, axis] - low[axis]) * scale))
        codes[i] = code
