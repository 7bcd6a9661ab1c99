"""Vertex values as an occlusion texture: a grey ramp, and texture coordinates that point into it.

A texture that is linear in u, sampled linearly at a u that is interpolated linearly, gives the interpolated value: any
viewer that shows occlusion textures shows vertex values, without an unwrapping of the mesh.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from raytrace.image.encode import linear_png
from raytrace.types import AnyFloats, Float64s

LEVELS = 256
_ROWS = 4


@cache
def ramp_png() -> bytes:
    """A PNG file of 256 × 4 greys of 8 bits: texel i of a row is i."""
    return linear_png(np.tile(np.arange(LEVELS, dtype=np.uint8), (_ROWS, 1))[..., None])


def ramp_coordinates(w: AnyFloats) -> Float64s:
    """Texture coordinates (n, 2) at which the ramp is w (n,), in [0, 1].

    255 w is the place between the centres of the first and the last texel, which lie at (i + ½)/256.
    """
    u = ((LEVELS - 1) * np.clip(np.asarray(w, np.float64), 0.0, 1.0) + 0.5) / LEVELS
    return np.stack([u, np.full_like(u, 0.5)], axis=-1)
