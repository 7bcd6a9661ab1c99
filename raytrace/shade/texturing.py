"""Textures at a hit, filtered over what a pixel covers: of albedo, obscurance and grain; and colours of vertices."""

from math import sqrt

import numpy as np

from ..image.texture_lookup import sample_texture
from ..kernel.jit import inline
from ..kernel.simd import WIDE, double, select, single
from ..kernel.simd_masks import pick, replace
from ..kernel.simd_memory import gather, gather3, load_row
from ..kernel.vector import add, cross, dot, multiply, perpendicular, scale, subtract
from ..mesh.interpolation import interpolate
from .camera_rays import pixel_width
from .interaction import between, corner, corner_rows, doubled, tangents
from .shading_points import AMBIENT, DIFFUSE, NORMAL, OCCLUSION, TANGENT, TINT, W, put, put1, take
from .workspace import BOOK, OFF

NOWHERE = 1e-4  # squared length of a direction: 8 bits have no exact zero


@inline
def texture_tint(entry, scene, item, mask, hits, view, missing):
    """Write an entry's TINT, or set its texture's element of `missing` to 1 if that has to be read first.

    Args: item, mask: the object and the lanes that have hit it; missing: int64 (textures,).
    """
    texture = scene.geometry.texture[item]
    if not at_hand(scene.textures, texture, missing):
        return
    s, t, footprint = texture_places(scene.geometry, scene.geometry.uv, item, mask, hits, view)
    for lane in range(WIDE):
        if pick(mask, lane):
            at = np.float64(pick(s, lane)), np.float64(pick(t, lane)), np.float64(pick(footprint, lane))
            red, green, blue = sample_texture(scene.textures, texture, at[0], at[1], at[2])
            entry[TINT, lane], entry[TINT + 1, lane], entry[TINT + 2, lane] = red, green, blue


@inline
def vertex_tint(entry, geometry, item, mask, hits):
    """Multiply an entry's TINT by the colours of vertices, linear between them. Args: as `texture_tint`."""
    if len(geometry.colours) > 0:
        i, j, k = corner_rows(geometry, item, mask, hits.faces)
        a, b, c = gather3(geometry.colours, i), gather3(geometry.colours, j), gather3(geometry.colours, k)
        put(entry, TINT, mask, multiply(take(entry, TINT), interpolate(a, b, c, hits.u, hits.v)))


@inline
def texture_occlusion(entry, scene, item, mask, hits, view, missing):
    """Multiply an entry's W by the occlusion texture's 1 + strength (R − 1), and note it as OCCLUSION.

    Source: Khronos glTF 2.0 specification, section 5.21 (material.occlusionTextureInfo). Args: as `texture_tint`.
    """
    put1(entry, OCCLUSION, mask, 1.0)
    texture, strength = scene.geometry.occlusion[item], scene.geometry.strength[item]
    if not at_hand(scene.textures, texture, missing):
        return
    s, t, footprint = texture_places(scene.geometry, scene.geometry.occlusion_uv, item, mask, hits, view)
    for lane in range(WIDE):
        if pick(mask, lane):
            at = np.float64(pick(s, lane)), np.float64(pick(t, lane)), np.float64(pick(footprint, lane))
            red, _, _ = sample_texture(scene.textures, texture, at[0], at[1], at[2])
            entry[OCCLUSION, lane] = 1.0 + strength * (red - 1.0)
            entry[W, lane] *= entry[OCCLUSION, lane]


@inline
def texture_grain(entry, scene, item, mask, hits, view, missing):
    """Turn an entry's TANGENT to where a texture of directions points; where it points nowhere, it is along u.

    Source: Khronos, KHR_materials_anisotropy (anisotropyTexture). Args: as `texture_tint`.
    """
    geometry, texture = scene.geometry, scene.geometry.grain[item]
    if not at_hand(scene.textures, texture, missing):
        return
    s, t, footprint = texture_places(geometry, geometry.uv, item, mask, hits, view)
    i, j, k = corner_rows(geometry, item, mask, hits.faces)
    p0 = corner(geometry, item, i)
    edge1, edge2 = subtract(corner(geometry, item, j), p0), subtract(corner(geometry, item, k), p0)
    _, along_v = tangents(geometry, i, j, k, edge1, edge2)
    u, v = perpendicular(take(entry, NORMAL), take(entry, TANGENT))
    v = scale(select(dot(v, along_v) < 0.0, -1.0, 1.0), v)
    x, y = 0.0 * s, 0.0 * s
    for lane in range(WIDE):
        if pick(mask, lane):
            at = np.float64(pick(s, lane)), np.float64(pick(t, lane)), np.float64(pick(footprint, lane))
            red, green, _ = sample_texture(scene.textures, texture, at[0], at[1], at[2])
            x, y = replace(x, lane, 2.0 * red - 1.0), replace(y, lane, 2.0 * green - 1.0)
    somewhere = x * x + y * y > NOWHERE
    x, y = single(select(somewhere, x, 1.0)), single(select(somewhere, y, 0.0))
    put(entry, TANGENT, mask, add(scale(x, u), scale(y, v)))


@inline
def at_hand(textures, texture, missing):
    """Whether there is a texture of this number, and it has been read; if it has not, its `missing` becomes 1."""
    if texture < 0:
        return False
    if textures.depth[texture] == 0:
        missing[texture] = 1
        return False
    return True


@inline
def texture_places(geometry, uv, item, mask, hits, view):
    """Where hits look a texture up, and the width of what their pixels see of it: lanes of float64 and float32."""
    i, j, k = corner_rows(geometry, item, mask, hits.faces)
    u0, v0 = texture_coordinates(uv, i)
    u1, v1 = texture_coordinates(uv, j)
    u2, v2 = texture_coordinates(uv, k)
    s, t = between(u0, u1, u2, hits.u, hits.v), between(v0, v1, v2, hits.u, hits.v)
    p0 = corner(geometry, item, i)
    edge1, edge2 = subtract(corner(geometry, item, j), p0), subtract(corner(geometry, item, k), p0)
    across = cross(doubled(edge1), doubled(edge2))
    area = sqrt(dot(across, across))
    covered = abs((u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0))
    return s, t, pixel_width(view, hits.depth) * single(select(area > 0.0, sqrt(covered / area), 0.0))


@inline
def texture_coordinates(uv, vertices):
    """Texture coordinates of vertices, lanes of float64."""
    return double(gather(uv, 2 * vertices)), double(gather(uv, 2 * vertices + 1))


@inline
def apply_tint(entry, mask):
    """Multiply light that was gathered without the texture by it."""
    tint = take(entry, TINT)
    put(entry, AMBIENT, mask, multiply(take(entry, AMBIENT), tint))
    put(entry, DIFFUSE, mask, multiply(take(entry, DIFFUSE), tint))


@inline
def apply_occlusion(entry, mask, form):
    """Multiply light that was gathered without the occlusion texture by it: what w weights in a form of obscurance."""
    occlusion = load_row(entry, OCCLUSION)
    if form != OFF:
        put(entry, AMBIENT, mask, scale(occlusion, take(entry, AMBIENT)))
    if form == BOOK:
        put(entry, DIFFUSE, mask, scale(occlusion, take(entry, DIFFUSE)))
