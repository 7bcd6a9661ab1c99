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
from .shading_points import ALBEDO_MAP, AMBIENT, DIFFUSE, NORMAL, OCCLUSION, TANGENT, W, load3, store1, store3
from .workspace import BOOK, OFF

NOWHERE = 1e-4  # squared length of a direction: 8 bits have no exact zero


@inline
def map_albedo(packet, scene, item, mask, hits, view, missing):
    """Write ALBEDO_MAP, or set the texture's element of `missing` to 1 if the texture has to be read first.

    Args: item, mask: the object and the lanes that have hit it; missing: int64 (textures,).
    """
    texture = scene.geometry.texture[item]
    if not is_loaded(scene.textures, texture, missing):
        return
    s, t, footprint = texture_places(scene.geometry, scene.geometry.uv, item, mask, hits, view)
    for lane in range(WIDE):
        if pick(mask, lane):
            at = np.float64(pick(s, lane)), np.float64(pick(t, lane)), np.float64(pick(footprint, lane))
            colour = sample_texture(scene.textures, texture, at[0], at[1], at[2])
            for c in range(3):
                packet[ALBEDO_MAP + c, lane] = colour[c]


@inline
def map_vertex_colours(packet, geometry, item, mask, hits):
    """Multiply ALBEDO_MAP by colours of vertices, linear between them. Args: as `map_albedo`."""
    if len(geometry.colours) > 0:
        i, j, k = corner_rows(geometry, item, mask, hits.faces)
        a, b, c = gather3(geometry.colours, i), gather3(geometry.colours, j), gather3(geometry.colours, k)
        colour = interpolate(a, b, c, hits.u, hits.v)
        store3(packet, ALBEDO_MAP, mask, multiply(load3(packet, ALBEDO_MAP), colour))


@inline
def map_occlusion(packet, scene, item, mask, hits, view, missing):
    """Multiply W by the occlusion texture's 1 + strength (R − 1), which is stored as OCCLUSION.

    Source: Khronos glTF 2.0 specification, section 5.21 (material.occlusionTextureInfo). Args: as `map_albedo`.
    """
    store1(packet, OCCLUSION, mask, 1.0)
    texture, strength = scene.geometry.occlusion[item], scene.geometry.strength[item]
    if not is_loaded(scene.textures, texture, missing):
        return
    s, t, footprint = texture_places(scene.geometry, scene.geometry.occlusion_uv, item, mask, hits, view)
    for lane in range(WIDE):
        if pick(mask, lane):
            at = np.float64(pick(s, lane)), np.float64(pick(t, lane)), np.float64(pick(footprint, lane))
            red, _, _ = sample_texture(scene.textures, texture, at[0], at[1], at[2])
            packet[OCCLUSION, lane] = 1.0 + strength * (red - 1.0)
            packet[W, lane] *= packet[OCCLUSION, lane]


@inline
def map_grain(packet, scene, item, mask, hits, view, missing):
    """Turn TANGENT to where a texture of directions points; where it has no direction, TANGENT is along u.

    Source: Khronos, KHR_materials_anisotropy (anisotropyTexture). Args: as `map_albedo`.
    """
    geometry, texture = scene.geometry, scene.geometry.grain[item]
    if not is_loaded(scene.textures, texture, missing):
        return
    s, t, footprint = texture_places(geometry, geometry.uv, item, mask, hits, view)
    i, j, k = corner_rows(geometry, item, mask, hits.faces)
    p0 = corner(geometry, item, i)
    edge1, edge2 = subtract(corner(geometry, item, j), p0), subtract(corner(geometry, item, k), p0)
    _, along_v = tangents(geometry, i, j, k, edge1, edge2)
    u, v = perpendicular(load3(packet, NORMAL), load3(packet, TANGENT))
    v = scale(select(dot(v, along_v) < 0.0, -1.0, 1.0), v)
    x, y = 0.0 * s, 0.0 * s
    for lane in range(WIDE):
        if pick(mask, lane):
            at = np.float64(pick(s, lane)), np.float64(pick(t, lane)), np.float64(pick(footprint, lane))
            red, green, _ = sample_texture(scene.textures, texture, at[0], at[1], at[2])
            x, y = replace(x, lane, 2.0 * red - 1.0), replace(y, lane, 2.0 * green - 1.0)
    somewhere = x * x + y * y > NOWHERE
    x, y = single(select(somewhere, x, 1.0)), single(select(somewhere, y, 0.0))
    store3(packet, TANGENT, mask, add(scale(x, u), scale(y, v)))


@inline
def is_loaded(textures, texture, missing):
    """Whether there is a texture of this number that has been read; if it has not, its `missing` becomes 1."""
    if texture < 0:
        return False
    if textures.depth[texture] == 0:
        missing[texture] = 1
        return False
    return True


@inline
def texture_places(geometry, uv, item, mask, hits, view):
    """Texture coordinates of hits, float64 lanes, and the width of a pixel's footprint there, float32 lanes."""
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
    return double(gather(uv, 2 * vertices)), double(gather(uv, 2 * vertices + 1))


@inline
def apply_albedo_map(packet, mask):
    """Multiply light that was gathered without ALBEDO_MAP by it."""
    albedo = load3(packet, ALBEDO_MAP)
    store3(packet, AMBIENT, mask, multiply(load3(packet, AMBIENT), albedo))
    store3(packet, DIFFUSE, mask, multiply(load3(packet, DIFFUSE), albedo))


@inline
def apply_occlusion(packet, mask, form):
    """Multiply light that was gathered without OCCLUSION by it: the light that w weights in a form of obscurance."""
    occlusion = load_row(packet, OCCLUSION)
    if form != OFF:
        store3(packet, AMBIENT, mask, scale(occlusion, load3(packet, AMBIENT)))
    if form == BOOK:
        store3(packet, DIFFUSE, mask, scale(occlusion, load3(packet, DIFFUSE)))
