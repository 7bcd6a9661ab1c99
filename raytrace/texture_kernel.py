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
    left, right, s = neighbours(wrapped(u), width)
    upper, lower, t = neighbours(wrapped(-v), height)
    upper, lower = start + upper * width, start + lower * width
    return (
        blend(texels, upper + left, upper + right, lower + left, lower + right, s, t, 0),
        blend(texels, upper + left, upper + right, lower + left, lower + right, s, t, 1),
        blend(texels, upper + left, upper + right, lower + left, lower + right, s, t, 2),
    )


@inline
def neighbours(place, size):
    """Along an axis of `size` texels: the two around `place`, in [0, 1), and the part of the way to the second."""
    x = place * size - 0.5
    before = np.floor(x)
    first = int(before) if before >= 0.0 else size - 1
    second = first + 1 if first + 1 < size else 0
    return first, second, x - before


@inline
def blend(texels, a, b, c, d, s, t, channel):
    """Bilinear mean of four texels: a, b above, c, d below."""
    above = lerp(s, texels[a, channel], texels[b, channel])
    return lerp(t, above, lerp(s, texels[c, channel], texels[d, channel]))


@inline
def wrapped(x):
    """The fractional part of x, in [0, 1); 0 if x is not finite."""
    part = x - np.floor(x)
    return part if 0.0 <= part < 1.0 else 0.0


@inline
def lerp(part, a, b):
    """a at part 0, b at part 1, in double precision."""
    return np.float64(a) + part * (np.float64(b) - np.float64(a))
