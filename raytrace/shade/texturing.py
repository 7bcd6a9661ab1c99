"""The albedo texture at a hit, filtered over what one pixel covers."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..image.texture_lookup import sample_texture
from ..kernel.jit import inline
from ..kernel.simd import WIDE, double, select, single
from ..kernel.simd_masks import pick
from ..kernel.simd_memory import gather, gather3
from ..kernel.vector import cross, dot, multiply, subtract
from .interaction import between, corner, doubled
from .shading_points import AMBIENT, DIFFUSE, TINT, put, take


class Textures(NamedTuple):
    """The arrays of `raytrace.image.texture.PackedTextures`; a texture that is not read yet has depth 0."""

    texels: npt.NDArray[np.float32]
    levels: npt.NDArray[np.int64]
    start: npt.NDArray[np.int64]
    depth: npt.NDArray[np.int64]
    wrap: npt.NDArray[np.int64]


@inline
def tint(entry, geometry, textures, wanted, item, mine, faces, u, v, width):
    """Set an entry's TINT, or mark its texture in `wanted` if it has to be read first.

    Args: item, mine, faces, u, v: hits as in `interaction.fill`; width: of a pixel there, in the world's units.
    """
    texture = geometry.texture[item]
    if texture < 0:
        return
    if textures.depth[texture] == 0:
        wanted[texture] = 1
        return
    i, j, k = gather3(geometry.faces, select(mine, faces, 0) + geometry.first_face[item])
    u0, v0 = texture_place(geometry, i)
    u1, v1 = texture_place(geometry, j)
    u2, v2 = texture_place(geometry, k)
    s0, s1 = between(u0, u1, u2, u, v), between(v0, v1, v2, u, v)
    p0 = corner(geometry, item, i)
    edge1, edge2 = subtract(corner(geometry, item, j), p0), subtract(corner(geometry, item, k), p0)
    across = cross(doubled(edge1), doubled(edge2))
    area = sqrt(dot(across, across))
    covered = abs((u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0))
    footprint = width * single(select(area > 0.0, sqrt(covered / area), 0.0))
    for lane in range(WIDE):
        if pick(mine, lane):
            at = np.float64(pick(s0, lane)), np.float64(pick(s1, lane)), np.float64(pick(footprint, lane))
            first, depth = textures.start[texture], textures.depth[texture]
            entry[TINT, lane], entry[TINT + 1, lane], entry[TINT + 2, lane] = sample_texture(
                textures.texels, textures.levels, first, depth, textures.wrap[texture], at[0], at[1], at[2]
            )


@inline
def texture_place(geometry, vertices):
    """Texture coordinates of vertices, lanes of float64."""
    return double(gather(geometry.uv, 2 * vertices)), double(gather(geometry.uv, 2 * vertices + 1))


@inline
def apply_tint(entry, mine):
    """Multiply light that was gathered without the texture by it."""
    tint = take(entry, TINT)
    put(entry, AMBIENT, mine, multiply(take(entry, AMBIENT), tint))
    put(entry, DIFFUSE, mine, multiply(take(entry, DIFFUSE), tint))
