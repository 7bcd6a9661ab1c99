"""Warps from the unit square to directions."""

import numpy as np

from ..types import Float64s


def cosine_hemisphere(u: Float64s, v: Float64s) -> Float64s:
    """Directions about +z with density cosθ/π from `u`, `v` in (0, 1): stacked before the last axis, (…, 3, n).

    Polar map (Malley's method): a uniform point on the disk, lifted to the hemisphere.
    """
    radius, azimuth = np.sqrt(u), 2 * np.pi * v
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), np.sqrt(1 - u)], axis=-2)
