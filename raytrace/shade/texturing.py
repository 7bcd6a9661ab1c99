"""The albedo texture at a hit, filtered over what one pixel covers."""

from math import sqrt

import numpy as np

from ..image.texture_lookup import sample_texture
from ..kernel.jit import inline
from ..kernel.simd import WIDE, double, select, single
from ..kernel.simd_masks import pick
from ..kernel.simd_memory import gather
from ..kernel.vector import cross, dot, multiply, subtract
from .camera_rays import pixel_width
from .interaction import between, corner, corner_rows, doubled
from .shading_points import AMBIENT, DIFFUSE, TINT, put, take


@inline
def texture_tint(entry, scene, item, mask, hits, view, missing):
    """Write an entry's TINT, or set its texture's element of `missing` to 1 if that has to be read first.

    Args: item, mask: the object and the lanes that have hit it; missing: int64 (textures,).
    """
    geometry, textures = scene.geometry, scene.textures
    texture = geometry.texture[item]
    if texture < 0:
        return
    if textures.depth[texture] == 0:
        missing[texture] = 1
        return
    i, j, k = corner_rows(geometry, item, mask, hits.faces)
    u0, v0 = texture_coordinates(geometry, i)
    u1, v1 = texture_coordinates(geometry, j)
    u2, v2 = texture_coordinates(geometry, k)
    s, t = between(u0, u1, u2, hits.u, hits.v), between(v0, v1, v2, hits.u, hits.v)
    p0 = corner(geometry, item, i)
    edge1, edge2 = subtract(corner(geometry, item, j), p0), subtract(corner(geometry, item, k), p0)
    across = cross(doubled(edge1), doubled(edge2))
    area = sqrt(dot(across, across))
    covered = abs((u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0))
    footprint = pixel_width(view, hits.depth) * single(select(area > 0.0, sqrt(covered / area), 0.0))
    for lane in range(WIDE):
        if pick(mask, lane):
            at = np.float64(pick(s, lane)), np.float64(pick(t, lane)), np.float64(pick(footprint, lane))
            red, green, blue = sample_texture(textures, texture, at[0], at[1], at[2])
            entry[TINT, lane], entry[TINT + 1, lane], entry[TINT + 2, lane] = red, green, blue


@inline
def texture_coordinates(geometry, vertices):
    """Texture coordinates of vertices, lanes of float64."""
    return double(gather(geometry.uv, 2 * vertices)), double(gather(geometry.uv, 2 * vertices + 1))


@inline
def apply_tint(entry, mask):
    """Multiply light that was gathered without the texture by it."""
    tint = take(entry, TINT)
    put(entry, AMBIENT, mask, multiply(take(entry, AMBIENT), tint))
    put(entry, DIFFUSE, mask, multiply(take(entry, DIFFUSE), tint))
