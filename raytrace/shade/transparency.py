"""Surfaces that let light through: what of it passes them, and what is seen behind them.

Embree calls `raytrace.shade.alpha_filter` at each hit: a shadow ray is traced once, a viewing ray once for each layer
that it sees. It goes on `STEP` behind it: surfaces nearer together than that, and triangles that meet in an edge, count
once.
"""

import numpy as np

from ..embree import DIR_X, GEOM_ID, INST_ID, ORG_X, PRIM_ID, TFAR, TNEAR, U, V, intersect16, occluded16
from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, count, lane_numbers, load_row, pick, select, some, store_row
from ..types import Bools, Float32Rows, Int32s
from . import alpha_filter, layout
from .alpha_filter import LEAST, STEP
from .camera_rays import View, aim
from .layout import BEGIN, COVER, NEXT, SHADOW_RAYS, TRANSMITTANCE, Geometry

HALF = 0.5
SHORT = 1.0 - 1e-5  # of the way to a light: what touches the light itself is no obstacle


@inline
def closest_hits(geometry, rays, valid, mask):
    """The closest hits of `rays` in the lanes of `mask`, past holes: rows of the objects, −1 for none, and of their
    shapes' faces, int32 lanes; barycentrics u, v and distance, float32 lanes."""
    if geometry.layered:
        store_row(rays, alpha_filter.TRANSMITTANCE, -1.0)
    store_row(valid, 0, mask)
    intersect16(geometry.handle, rays, valid)
    ids = rays.view(np.int32)
    outer = load_row(ids, INST_ID)
    inner = load_row(ids, GEOM_ID)
    items = select(mask, select((inner >= 0) & (outer >= 0), outer, inner), -1)
    return items, load_row(ids, PRIM_ID), load_row(rays, U), load_row(rays, V), load_row(rays, TFAR)


@inline
def transmittance(geometry, scratch, mask, origin, l, distance):
    """Which of the `mask` shadow rays light passes along, and δ there, float32 lanes: 1 − alpha of all that they hit,
    multiplied."""
    rays = scratch.rays
    transmitted = select(mask, 1.0, 1.0)
    for axis in range(3):
        store_row(rays, ORG_X + axis, origin[axis])
        store_row(rays, DIR_X + axis, l[axis])
    store_row(rays, TFAR, min(distance * SHORT, geometry.farthest))
    store_row(scratch.valid, 0, mask)
    if geometry.layered:
        store_row(rays, TNEAR, 0.0)
        store_row(rays, alpha_filter.TRANSMITTANCE, 1.0)
        store_row(rays, alpha_filter.COUNT, 0.0)
    occluded16(geometry.handle, rays, scratch.valid)
    scratch.counts[SHADOW_RAYS] += count(mask)
    if geometry.layered:
        transmitted = load_row(rays, alpha_filter.TRANSMITTANCE)
    return mask & (load_row(rays, TFAR) >= 0.0), transmitted


@inline
def begin_layers(scratch, packets):
    """Reset the viewing rays of the first packets, which have seen nothing yet."""
    for e in range(packets):
        accumulated = scratch.layers[e]
        for column in range(layout.FILM):
            store_row(accumulated, column, 0.0)
        store_row(accumulated, layout.W, 1.0)
        store_row(accumulated, layout.SHADOW, 1.0)
        store_row(accumulated, layout.DEPTH, np.float32(np.inf))
        store_row(accumulated, TRANSMITTANCE, 1.0)
        store_row(accumulated, BEGIN, 0.0)
        store_row(scratch.active_rays, e, lane_numbers() + e * WIDE)


@inline
def composite(scratch, packets, layers):
    """Composite hits, or the background, behind earlier hits of their rays; returns the packets of rays that go on."""
    active = 0
    for e in range(packets):
        for lane in range(WIDE):
            ray = scratch.active_rays[e, lane]
            if ray >= 0 and composite_ray(scratch, e, lane, scratch.layers[ray // WIDE], ray % WIDE, layers):
                scratch.active_rays[active // WIDE, active % WIDE] = ray
                active += 1
    remaining = -(-active // WIDE)
    for slot in range(active, remaining * WIDE):
        scratch.active_rays[slot // WIDE, slot % WIDE] = -1
    return remaining


@inline
def composite_ray(scratch, e, lane, accumulated, ray, layers):
    """Composite the hit of one lane of packet e behind the earlier hits of its ray; returns whether the ray goes on.

    Layers that are no light show the first surface behind which less than half of the light passes.

    Args:
        accumulated: sums of all rays, by columns; `ray` is the one to add to.
        layers: whether these layers are made.
    """
    packet = scratch.points[e]
    noted = scratch.layers[e]
    hit = scratch.items[e, lane] >= 0
    before = accumulated[TRANSMITTANCE, ray]
    weight = before * noted[COVER, lane] if hit else before
    for column in range(layout.AMBIENT, layout.W):
        accumulated[column, ray] += weight * packet[column, lane]
    behind = before - weight * packet[layout.ALPHA, lane] if hit else before
    behind = behind if behind > LEAST else np.float32(0.0)
    if layers and hit and before > HALF and behind <= HALF:
        for column in range(layout.W, layout.FILM):
            accumulated[column, ray] = packet[column, lane]
    accumulated[layout.ALPHA, ray] = np.float32(1.0) - behind
    accumulated[TRANSMITTANCE, ray] = behind
    accumulated[BEGIN, ray] = noted[NEXT, lane]
    return hit and behind > 0.0


@kernel
def mark_seen(
    geometry: Geometry,
    view: View,
    columns: tuple[int, int],
    pixel_rows: tuple[int, int],
    rays: Float32Rows,
    valid: Int32s,
    seen: Bools,
    whole_polygons: bool,
) -> None:
    """Set `seen`, bool (w,), for the vertices of all faces that a sample of some pixels meets.

    Args:
        columns, pixel_rows: of the pixels, (first, end).
        whole_polygons: set it for all vertices of the faces' polygons, too.
    """
    left, right = columns
    for y in range(pixel_rows[0], pixel_rows[1]):
        for x in range(left, right, WIDE):
            pixels = lane_numbers() + x
            for sample in range(max(1, view.offsets.shape[2])):
                aim(rays, view, pixels, 0 * pixels + y, 0 * pixels + sample, geometry.farthest)
                active = pixels < right
                transmitted = select(active, 1.0, 1.0)
                while some(active):
                    items, faces, _, _, distance = closest_hits(geometry, rays, valid, active)
                    mark_corners(geometry, items, faces, seen, whole_polygons)
                    active = items < items
                    if geometry.layered:
                        transmitted = transmitted * (1.0 - load_row(rays, alpha_filter.STOPPED))
                        active = (items >= 0) & (transmitted > LEAST)
                        store_row(rays, TNEAR, distance + STEP)
                        store_row(rays, TFAR, geometry.farthest)


@inline
def mark_corners(geometry, items, faces, seen, whole_polygons):
    """Set `seen` for the vertices of faces that were hit. Args: items, faces: as `closest_hits` returns them."""
    for lane in range(WIDE):
        item = pick(items, lane)
        if item >= 0:
            shift = geometry.first_w[item] - geometry.first_vertex[item]
            face = geometry.first_face[item] + pick(faces, lane)
            for corner in range(3):
                seen[shift + geometry.faces[face, corner]] = True
            if whole_polygons and geometry.polygons[face] >= 0:
                polygon = geometry.polygons[face] - (len(geometry.vertices) - len(geometry.first_edge) + 1)
                for edge in range(geometry.first_edge[polygon], geometry.first_edge[polygon + 1]):
                    seen[shift + geometry.edges[edge, 0]] = True
