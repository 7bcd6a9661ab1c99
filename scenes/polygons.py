"""Polygons to triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def fan_triangles(corners: npt.NDArray[np.integer[Any]], sizes: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.int64]:
    """Each polygon as a fan about its first corner, in the polygons' order; exact for convex ones.

    Args:
        corners: (sum of sizes,) vertex indices, polygon after polygon.
        sizes: (p,) corners of each polygon. One of fewer than three gives no triangle.

    Returns:
        int64 (m, 3).

    Raises:
        ValueError: `corners` has another length than the sum of `sizes`.
    """
    if sizes.sum() != len(corners):
        raise ValueError(f"{len(corners)} corners for polygons of {sizes.sum()}")
    vertices = corners.astype(np.int64)
    if (sizes == 3).all():
        return vertices.reshape(-1, 3)
    triangles = np.maximum(sizes.astype(np.int64) - 2, 0)
    first = np.repeat(np.cumsum(sizes) - sizes, triangles)
    step = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return vertices[np.stack([first, first + step + 1, first + step + 2], axis=1)]
