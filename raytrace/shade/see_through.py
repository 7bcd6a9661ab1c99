"""Surfaces that let light through: what of it passes them, and what is seen behind them.

Embree calls `raytrace.materials.alpha_filter` at each hit: a shadow ray is traced once, a viewing ray once for each
layer that it sees. It goes on `STEP` behind it: surfaces nearer together than that, and triangles that meet in an edge,
count once.

Where all is opaque, `opacity` is None, and kernels are compiled without any of this.
"""

import numpy as np

from ..embree.packets import GEOM_ID, INST_ID, PRIM_ID, TFAR, TNEAR, U, V, intersect16, occluded16
from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, double, lane_numbers, load_row, pick, select, single, some, store_row
from ..kernel.vector import scale
from ..materials import alpha_filter
from ..materials.alpha_filter import LEAST, STEP
from . import shading_points as layout
from .camera_rays import aim
from .shading_points import BEGIN, BEHIND, COVER, THROUGH

HALF = 0.5


@inline
def closest_hits(opacity, geometry, rays, valid, there):
    """The closest hits of `rays` where the mask `there` is set, past holes.

    Returns: rows of the objects hit, −1 for none, and of their shapes' faces, int32 lanes; barycentrics u, v and
    distance, float32 lanes.
    """
    if opacity is not None:
        store_row(rays, alpha_filter.THROUGH, -1.0)
    store_row(valid, 0, there)
    intersect16(geometry.handle, rays, valid)
    ids = rays.view(np.int32)
    outer, inner = load_row(ids, INST_ID), load_row(ids, GEOM_ID)
    items = select(there, select((inner >= 0) & (outer >= 0), outer, inner), -1)
    return items, load_row(ids, PRIM_ID), load_row(rays, U), load_row(rays, V), load_row(rays, TFAR)


@inline
def behind(opacity, geometry, rays, items, distance, through):
    """Continue viewing rays behind their `closest_hits`: a mask of the rays that do, and their transmittance."""
    if opacity is None:
        return items < items, through
    through = through * (1.0 - load_row(rays, alpha_filter.STOPPED))
    store_row(rays, TNEAR, distance + STEP)
    store_row(rays, TFAR, geometry.farthest)
    return (items >= 0) & (through > LEAST), through


@inline
def transmittance(opacity, geometry, rays, valid, wanted, limit):
    """δ of shadow rays up to the distances `limit`: the product of 1 − alpha over all surfaces that they hit.

    Returns: the mask of the `wanted` rays that light passes along, and δ for `attenuate`, float32 lanes.
    """
    store_row(rays, TFAR, limit)
    store_row(valid, 0, wanted)
    if opacity is not None:
        store_row(rays, TNEAR, 0.0)
        store_row(rays, alpha_filter.THROUGH, 1.0)
        store_row(rays, alpha_filter.COUNT, 0.0)
    occluded16(geometry.handle, rays, valid)
    lit, part = wanted & (load_row(rays, TFAR) >= 0.0), limit
    if opacity is not None:
        part = select(lit, load_row(rays, alpha_filter.THROUGH), 0.0)
    return lit, part


@inline
def attenuate(opacity, part, a):
    """The triple `a` times the part of the light that passes; `a` itself where all is opaque."""
    if opacity is None:
        return a
    return scale(part, a)


@inline
def seen_packets(opacity, scratch):
    """The packets that hold the light of viewing rays in the end: `layers`, or `points` where all is opaque."""
    if opacity is None:
        return scratch.points
    return scratch.layers


@inline
def begin_layers(opacity, scratch, packets):
    """Reset the viewing rays of the first `packets` packets, which have seen nothing yet; returns `packets`."""
    if opacity is not None:
        for e in range(packets):
            kept = scratch.layers[e]
            for column in range(layout.FILM):
                store_row(kept, column, 0.0)
            store_row(kept, layout.W, 1.0)
            store_row(kept, layout.SHADOW, 1.0)
            store_row(kept, layout.DEPTH, np.float32(np.inf))
            store_row(kept, THROUGH, 1.0)
            store_row(kept, BEGIN, 0.0)
            store_row(scratch.going, e, lane_numbers() + e * WIDE)
    return packets


@inline
def ray_numbers(opacity, scratch, e):
    """Numbers of the viewing rays of packet e, lanes, −1 for none."""
    if opacity is None:
        return lane_numbers() + e * WIDE
    return load_row(scratch.going, e)


@inline
def begin_behind(opacity, scratch, numbers):
    """Start the rays of these `numbers` behind the layers that they have seen."""
    if opacity is not None:
        for lane in range(WIDE):
            ray = max(pick(numbers, lane), 0)
            scratch.rays[TNEAR, lane] = scratch.layers[ray // WIDE, BEGIN, ray % WIDE]


@inline
def keep_hits(opacity, scratch, e, distance):
    """Store where the rays of packet e would go on, and the alpha of what they hit."""
    if opacity is not None:
        store_row(scratch.layers[e], BEHIND, distance + STEP)
        store_row(scratch.layers[e], COVER, load_row(scratch.rays, alpha_filter.MET_ALPHA))


@inline
def composite(opacity, scratch, packets, layers):
    """Composite hits, or the background, behind earlier hits of their rays; returns the packets of rays that go on.

    Args: layers: whether all layers of a picture are wanted. Layers that are no light show the first surface behind
        which less than half of the light passes.
    """
    going = 0
    if opacity is not None:
        for e in range(packets):
            for lane in range(WIDE):
                ray = scratch.going[e, lane]
                if ray >= 0 and composite_ray(scratch, e, lane, scratch.layers[ray // WIDE], ray % WIDE, layers):
                    scratch.going[going // WIDE, going % WIDE] = ray
                    going += 1
        for place in range(going, -(-going // WIDE) * WIDE):
            scratch.going[place // WIDE, place % WIDE] = -1
    return -(-going // WIDE)


@inline
def composite_ray(scratch, e, lane, kept, ray, layers):
    """Composite the hit of a lane of packet e behind what its ray has `kept`; returns whether the ray goes on."""
    packet, noted, met = scratch.points[e], scratch.layers[e], scratch.items[e, lane] >= 0
    through = kept[THROUGH, ray]
    part = through * noted[COVER, lane] if met else through
    for column in range(layout.AMBIENT, layout.W):
        kept[column, ray] += part * packet[column, lane]
    left = through - part * packet[layout.ALPHA, lane] if met else through
    left = left if left > LEAST else np.float32(0.0)
    if layers and met and through > HALF and left <= HALF:
        for column in range(layout.W, layout.FILM):
            kept[column, ray] = packet[column, lane]
    kept[layout.ALPHA, ray], kept[THROUGH, ray], kept[BEGIN, ray] = np.float32(1.0) - left, left, noted[BEHIND, lane]
    return met and left > 0.0


@kernel
def mark_seen(geometry, view, columns, rows, rays, valid, seen, whole):
    """Set `seen`, bool (w,), for the vertices of all faces that a sample of some pixels meets.

    Args: columns, rows: of the pixels, (first, end). packet, valid: of `raytrace.embree.packets.new_packet`, sixteen.
        whole: also for all vertices of the faces' polygons.
    """
    left, right = columns
    for y in range(rows[0], rows[1]):
        for x in range(left, right, WIDE):
            pixels = lane_numbers() + x
            for sample in range(max(1, view.offsets.shape[2])):
                aim(rays, view, pixels, 0 * pixels + y, 0 * pixels + sample, geometry.farthest)
                there, through = pixels < right, single(double(0 * pixels + 1))
                while some(there):
                    items, faces, _, _, distance = closest_hits(geometry.opacity, geometry, rays, valid, there)
                    mark_corners(geometry, items, faces, seen, whole)
                    there, through = behind(geometry.opacity, geometry, rays, items, distance, through)


@inline
def mark_corners(geometry, items, faces, seen, whole):
    """Set `seen` for the vertices of faces that were hit. Args: items, faces: as `closest_hits` returns them."""
    for lane in range(WIDE):
        item = pick(items, lane)
        if item >= 0:
            shift = geometry.first_w[item] - geometry.first_vertex[item]
            face = geometry.first_face[item] + pick(faces, lane)
            for corner in range(3):
                seen[shift + geometry.faces[face, corner]] = True
            if whole and geometry.polygons[face] >= 0:
                polygon = geometry.polygons[face] - (len(geometry.vertices) - len(geometry.first_edge) + 1)
                for edge in range(geometry.first_edge[polygon], geometry.first_edge[polygon + 1]):
                    seen[shift + geometry.edges[edge, 0]] = True
