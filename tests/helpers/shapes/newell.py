"""Normals of polygons."""

import numpy as np


def newell_normal(corners):
    """Unit normal (3,) of a polygon (k, 3), k ≥ 3, convex or not, not quite planar too (Martin Newell's sums)."""
    corners = np.asarray(corners, np.float64)
    following = np.roll(corners, -1, axis=0)
    sums = np.sum(np.roll(corners - following, -1, axis=1) * np.roll(corners + following, -2, axis=1), axis=0)
    return sums / np.linalg.norm(sums)
