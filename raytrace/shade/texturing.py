"""Textures at a hit, filtered over what a pixel covers: of albedo, obscurance and grain; and colours of vertices."""

from math import sqrt

import numpy as np

from ..image.texture_lookup import sample_texture
from ..kernel.jit import inline
from ..kernel.simd import WIDE, double, gather, gather3, lane_numbers, load_row, pick, replace, select, single
from ..kernel.vector import add, cross, dot, multiply, perpendicular, scale
from .camera_rays import pixel_width
from .interaction import between, corner_rows, doubled, edges, interpolate, rounded, tangents
from .layout import ALBEDO_MAP, NORMAL, OCCLUSION, TANGENT, W, load3, store1, store3

NOWHERE = 1e-4  # squared length of a direction: 8 bits have no exact zero


@inline
def map_albedo(packet, scene, item, mask, hits, view, missing):
    """Write ALBEDO_MAP: the texture, times colours of vertices, linear between them.

    Args: item, mask: the object and the lanes that have hit it; missing: as `is_loaded`.
    """
    geometry, texture = scene.geometry, scene.geometry.texture[item]
    store3(packet, ALBEDO_MAP, mask, (1.0, 1.0, 1.0))
    if is_loaded(scene.textures, texture, missing):
        colour = sample_hits(scene, texture, geometry.uv, item, mask, hits, view)
        store3(packet, ALBEDO_MAP, mask, rounded(colour))
    if len(geometry.colours) > 0:
        i, j, k = corner_rows(geometry, item, mask, hits.faces)
        a = gather3(geometry.colours, i)
        b = gather3(geometry.colours, j)
        c = gather3(geometry.colours, k)
        colour = interpolate(a, b, c, hits.u, hits.v)
        store3(packet, ALBEDO_MAP, mask, multiply(load3(packet, ALBEDO_MAP), colour))


@inline
def map_occlusion(packet, scene, item, mask, hits, view, missing):
    """Multiply W by the occlusion texture's 1 + strength (R − 1), stored as OCCLUSION (glTF 2.0, section 5.21)."""
    store1(packet, OCCLUSION, mask, 1.0)
    texture = scene.geometry.occlusion[item]
    strength = scene.geometry.strength[item]
    if is_loaded(scene.textures, texture, missing):
        red, _, _ = sample_hits(scene, texture, scene.geometry.occlusion_uv, item, mask, hits, view)
        occlusion = single(1.0 + strength * (red - 1.0))
        store1(packet, OCCLUSION, mask, occlusion)
        store1(packet, W, mask, load_row(packet, W) * occlusion)


@inline
def map_grain(packet, scene, item, mask, hits, view, missing):
    """Turn TANGENT, along u, to where a texture of directions points, if anywhere (glTF, KHR_materials_anisotropy)."""
    geometry, texture = scene.geometry, scene.geometry.grain[item]
    if not is_loaded(scene.textures, texture, missing):
        return
    red, green, _ = sample_hits(scene, texture, geometry.uv, item, mask, hits, view)
    i, j, k = corner_rows(geometry, item, mask, hits.faces)
    edge1, edge2 = edges(geometry, item, i, j, k)
    _, along_v = tangents(geometry, i, j, k, edge1, edge2)
    u, v = perpendicular(load3(packet, NORMAL), load3(packet, TANGENT))
    v = scale(select(dot(v, along_v) < 0.0, -1.0, 1.0), v)
    x = 2.0 * red - 1.0
    y = 2.0 * green - 1.0
    somewhere = x * x + y * y > NOWHERE
    x = single(select(somewhere, x, 1.0))
    y = single(select(somewhere, y, 0.0))
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
def sample_hits(scene, texture, uv, item, mask, hits, view):
    """Linear RGB of a texture at hits, float64 lanes, filtered over what a pixel covers; 0 where `mask` is not set."""
    geometry = scene.geometry
    i, j, k = corner_rows(geometry, item, mask, hits.faces)
    u0, v0 = texture_coordinates(uv, i)
    u1, v1 = texture_coordinates(uv, j)
    u2, v2 = texture_coordinates(uv, k)
    edge1, edge2 = edges(geometry, item, i, j, k)
    across = cross(doubled(edge1), doubled(edge2))
    area = sqrt(dot(across, across))
    covered = abs((u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0))
    footprint = pixel_width(view, hits.depth) * single(select(area > 0.0, sqrt(covered / area), 0.0))
    s = between(u0, u1, u2, hits.u, hits.v)
    t = between(v0, v1, v2, hits.u, hits.v)
    return sample_lanes(scene.textures, texture, s, t, footprint, mask)


@inline
def sample_lanes(textures, texture, s, t, footprint, mask):
    """Linear RGB of a texture at (s, t) over these widths, float64 lanes; 0 where `mask` is not set."""
    red = green = blue = double(lane_numbers() * 0)
    for lane in range(WIDE):
        if pick(mask, lane):
            width = np.float64(pick(footprint, lane))
            r, g, b = sample_texture(textures, texture, pick(s, lane), pick(t, lane), width)
            red = replace(red, lane, r)
            green = replace(green, lane, g)
            blue = replace(blue, lane, b)
    return red, green, blue


@inline
def texture_coordinates(uv, vertices):
    """u and v of vertices, float64 lanes. Args: uv: flat, two numbers a vertex."""
    return double(gather(uv, 2 * vertices)), double(gather(uv, 2 * vertices + 1))
