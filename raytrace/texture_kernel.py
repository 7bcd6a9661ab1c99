"""Looking a texture up: bilinear within a level of its pyramid, linear between two levels (Williams 1983)."""

from __future__ import annotations

from math import log2

import numpy as np

from raytrace.jit import inline


@inline
def sample_texture(texels, levels, first, count, u, v, footprint):
    """Linear RGB of a texture at (u, v), which repeats in both directions.

    Args:
        texels, levels: of `PackedTextures`.
        first, count: the texture's entries there; a texture that was left out (count 0) is white.
        u, v: (0, 0) is the lower left corner of the image, (1, 1) the upper right.
        footprint: width in uv of what a pixel sees; 0 looks at the finest level alone.
    """
    if count == 0:
        return (1.0, 1.0, 1.0)
    width = footprint * max(levels[first, 1], levels[first, 2])
    if not width > 1.0:
        return bilinear(texels, levels, first, u, v)
    level = min(log2(width), count - 1.0)
    lower = int(level)
    r, g, b = bilinear(texels, levels, first + lower, u, v)
    part = level - lower
    if part > 0.0:
        coarse = bilinear(texels, levels, first + lower + 1, u, v)
        r += part * (coarse[0] - r)
        g += part * (coarse[1] - g)
        b += part * (coarse[2] - b)
    return (r, g, b)


@inline
def bilinear(texels, levels, level, u, v):
    """Linear RGB within a level; texel centres lie at half integers. (u, v) that are not finite count as 0."""
    start, width, height = levels[level, 0], levels[level, 1], levels[level, 2]
    x = wrapped(u) * width - 0.5
    y = wrapped(-v) * height - 0.5
    column, row = np.floor(x), np.floor(y)
    s, t = x - column, y - row
    left, right = int(column) % width, int(column + 1.0) % width
    upper, lower = start + int(row) % height * width, start + int(row + 1.0) % height * width
    a, b, c, d = texels[upper + left], texels[upper + right], texels[lower + left], texels[lower + right]
    return (
        lerp(t, lerp(s, a[0], b[0]), lerp(s, c[0], d[0])),
        lerp(t, lerp(s, a[1], b[1]), lerp(s, c[1], d[1])),
        lerp(t, lerp(s, a[2], b[2]), lerp(s, c[2], d[2])),
    )


@inline
def wrapped(x):
    """The fractional part of x, in [0, 1); 0 if x is not finite."""
    part = x - np.floor(x)
    return part if 0.0 <= part < 1.0 else 0.0


@inline
def lerp(part, a, b):
    """a at part 0, b at part 1, in double precision."""
    return np.float64(a) + part * (np.float64(b) - np.float64(a))
