"""Trilinear texture lookup: bilinear within a level of the pyramid, linear between two levels (Williams 1983).

Beyond the image a wrap mode holds along each axis, as in glTF: Khronos glTF 2.0 specification, 5.26.
"""

from math import log2
from typing import NamedTuple

import numpy as np

from ..kernel.jit import inline, kernel
from ..types import Float32Rows, Float64Rows, Int64Rows, Int64s

REPEAT, MIRRORED_REPEAT, CLAMP_TO_EDGE = range(3)  # places in `raytrace.image.texture.WRAPS`


class PackedTextures(NamedTuple):
    """Textures as kernels read them: pyramids of images halved down to one texel."""

    texels: Float32Rows  # (n, 3), linear RGB; levels one after the other, rows from the top
    levels: Int64Rows  # (m, 3): first texel, width, height of each level; finest first
    first_level: Int64s  # (t,): each texture's finest level
    depth: Int64s  # (t,): each texture's number of levels, 0 before it is read
    wrap: Int64Rows  # (t, 2): its modes along u and v, places in `WRAPS`


@inline
def sample_texture(textures, number, u, v, footprint):
    """Linear RGB of a texture at (u, v), from the lower left corner of the image; white of one that is not read.

    Args: textures: `PackedTextures`. footprint: width in uv of what a pixel sees; 0 looks at the finest level alone.
    """
    texels, levels = textures.texels, textures.levels
    first_texel = textures.first_level[number]
    depth = textures.depth[number]
    wrap = textures.wrap[number]
    if depth == 0:
        return (1.0, 1.0, 1.0)
    width = footprint * max(levels[first_texel, 1], levels[first_texel, 2])
    if not width > 1.0:
        return bilinear(texels, levels, first_texel, wrap, u, v)
    level = min(log2(width), depth - 1.0)
    lower = int(level)
    r, g, b = bilinear(texels, levels, first_texel + lower, wrap, u, v)
    part = level - lower
    if part > 0.0:
        coarse = bilinear(texels, levels, first_texel + lower + 1, wrap, u, v)
        r += part * (coarse[0] - r)
        g += part * (coarse[1] - g)
        b += part * (coarse[2] - b)
    return (r, g, b)


@kernel
def sample_points(textures: PackedTextures, number: int, uv: Float64Rows, out: Float64Rows) -> None:
    """Write the linear RGB (n, 3) of a texture at places uv (n, 2), by its finest level."""
    for row in range(len(uv)):
        out[row, 0], out[row, 1], out[row, 2] = sample_texture(textures, number, uv[row, 0], uv[row, 1], 0.0)


@inline
def bilinear(texels, levels, level, wrap, u, v):
    """Linear RGB within a level; texel centres lie at half integers. (u, v) that are not finite count as 0."""
    around = four_texels(levels[level], wrap, u, v)
    return blend(texels, around, 0), blend(texels, around, 1), blend(texels, around, 2)


@inline
def four_texels(level, wrap, u, v):
    """The texels around (u, v), two above and two below, and the parts of the way to the right and down.

    Args: level: its first texel, width and height. wrap: modes along u and v.
    """
    left, right, s = neighbours(u, level[1], wrap[0])
    upper, lower, t = neighbours(1.0 - v, level[2], wrap[1])
    upper = level[0] + upper * level[1]
    lower = level[0] + lower * level[1]
    return upper + left, upper + right, lower + left, lower + right, s, t


@inline
def neighbours(position, size, wrap):
    """Along an axis of `size` texels: the two around `position`, and the part of the way to the second."""
    x = wrapped(position, wrap) * size - 0.5
    before = np.floor(x)
    lower = int(before)
    second = int(before) + 1
    if wrap == REPEAT:
        return lower if lower >= 0 else size - 1, second if second < size else 0, x - before
    return max(lower, 0), min(second, size - 1), x - before


@inline
def blend(texels, around, channel):
    """Bilinear mean of a channel over the texels `around`, of `four_texels`."""
    a, b, c, d, s, t = around
    above = lerp(s, texels[a, channel], texels[b, channel])
    return lerp(t, above, lerp(s, texels[c, channel], texels[d, channel]))


@inline
def wrapped(x, wrap):
    """The coordinate in [0, 1] for x, by a wrap mode; 0 if x is not finite."""
    if not np.isfinite(x):
        return 0.0
    if wrap == CLAMP_TO_EDGE:
        return min(max(x, 0.0), 1.0)
    if wrap == MIRRORED_REPEAT:
        return 1.0 - abs(x - 2.0 * np.floor(0.5 * x) - 1.0)
    part = x - np.floor(x)
    return part if part < 1.0 else 0.0


@inline
def lerp(part, a, b):
    """Linear interpolation in double precision: a at part 0, b at part 1."""
    return np.float64(a) + part * (np.float64(b) - np.float64(a))
