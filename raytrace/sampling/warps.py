"""Warps from the unit square to directions."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def cosine_hemisphere(u: Floats, v: Floats) -> Floats:
    """Directions about +z with density cosθ/π from `u`, `v` in (0, 1): stacked before the last axis, (…, 3, n).

    Polar map (Malley's method): a uniform point on the disk, lifted to the hemisphere.
    """
    radius, azimuth = np.sqrt(u), 2 * np.pi * v
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), np.sqrt(1 - u)], axis=-2)
