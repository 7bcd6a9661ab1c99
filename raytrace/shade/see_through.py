"""Surfaces that let light through: what of it passes them, and what is seen behind them.

A hit has an alpha (`raytrace.mesh.opacity`): the part of the place that is there, 0 in a hole. What is there may let
light through by its material, so that a share 1 − alpha · (opacity of the material) passes. Rays go on `STEP` behind a
hit: surfaces nearer together than that, and triangles that meet in an edge, count once.

Where all is opaque, `opacity` is None, and kernels are compiled without any of this.
"""

import numpy as np

from ..brdf.layout import ALPHA as MATERIAL_ALPHA
from ..embree.packets import TFAR, TNEAR, U, V, intersect16, occluded16
from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, double, select, single
from ..kernel.simd_masks import lane_numbers, pick, replace, some
from ..kernel.simd_memory import load_row, store_row
from ..kernel.vector import scale
from ..mesh.opacity_lookup import alpha
from . import shading_points as layout
from .camera_rays import FARTHEST, aim, hit_ids
from .shading_points import BEGIN, COVER, THROUGH

STEP = np.float32(2.0**-17)  # in render space: 32 times what Embree's distances can be off
LEAST = 2.0**-16  # of the light: where less is left, nothing is
HALF = 0.5


@inline
def meet(opacity, geometry, packet, valid, there):
    """Trace the rays of a packet where the mask `there` is set, past holes.

    Returns: rows of the objects met, −1 for none, and of their shapes' faces, int32 lanes; barycentrics u, v, distance
    and alpha, float32 lanes.
    """
    if opacity is None:
        store_row(valid, 0, there)
        intersect16(geometry.handle, packet, valid)
        items, faces = hit_ids(packet)
        u = load_row(packet, U)
        return select(there, items, -1), faces, u, load_row(packet, V), load_row(packet, TFAR), u
    faces = 0 * lane_numbers()
    items, left = faces - 1, there
    u, v, distance, cover = single(double(faces)), single(double(faces)), single(double(faces)), single(double(faces))
    while some(left):
        store_row(valid, 0, left)
        intersect16(geometry.handle, packet, valid)
        found, face = hit_ids(packet)
        left = left & (found >= 0)
        here = alpha_of(opacity, geometry, packet, found, face, left)
        met = left & (here > 0.0)
        items, faces, cover = select(met, found, items), select(met, face, faces), select(met, here, cover)
        u, v = select(met, load_row(packet, U), u), select(met, load_row(packet, V), v)
        distance = select(met, load_row(packet, TFAR), distance)
        left = left & ~met
        go_on(packet, load_row(packet, TFAR), FARTHEST)
    return items, faces, u, v, distance, cover


@inline
def alpha_of(opacity, geometry, packet, items, faces, hit):
    """Alpha at the hits of a packet, float32 lanes, 0 where the mask `hit` is not set."""
    u, v = double(load_row(packet, U)), double(load_row(packet, V))
    found = single(0.0 * u)
    for lane in range(WIDE):
        if pick(hit, lane):
            face = geometry.first_face[pick(items, lane)] + pick(faces, lane)
            found = replace(found, lane, np.float32(alpha(opacity, face, pick(u, lane), pick(v, lane))))
    return found


@inline
def material_alpha(geometry, items):
    """Opacity of the objects' materials, float32 lanes; 1 for row −1."""
    found = single(double(0 * items + 1))
    for lane in range(WIDE):
        if pick(items, lane) >= 0:
            found = replace(found, lane, np.float32(geometry.rows[pick(items, lane), MATERIAL_ALPHA]))
    return found


@inline
def go_on(packet, distance, limit):
    """Let rays begin behind hits at `distance`. Args: limit: distance at which they end."""
    store_row(packet, TNEAR, distance + STEP)
    store_row(packet, TFAR, limit)


@inline
def behind(opacity, geometry, packet, items, met, through):
    """Where viewing rays go on behind what they `meet`, a mask, and what is left of them, float32 lanes.

    Args: met: the distance and the alpha of it. through: what was left before.
    """
    if opacity is None:
        return items < items, through
    distance, cover = met
    through = through * (1.0 - cover * material_alpha(geometry, items))
    go_on(packet, distance, FARTHEST)
    return (items >= 0) & (through > LEAST), through


@inline
def passing(opacity, geometry, packet, valid, wanted, limit):
    """δ of shadow rays up to the distances `limit`: the product of 1 − alpha over all that they meet.

    Returns: the mask of the `wanted` rays that some light passes along, and how much, float32 lanes: `dimmed` takes it.
    """
    store_row(packet, TFAR, limit)
    if opacity is None:
        store_row(valid, 0, wanted)
        occluded16(geometry.handle, packet, valid)
        return wanted & (load_row(packet, TFAR) >= 0.0), limit
    store_row(packet, TNEAR, 0.0)
    through, left = select(wanted, 1.0, 0.0), wanted
    while some(left):
        store_row(valid, 0, left)
        intersect16(geometry.handle, packet, valid)
        items, faces = hit_ids(packet)
        left = left & (items >= 0)
        items = select(left, items, -1)
        here = alpha_of(opacity, geometry, packet, items, faces, left)
        through = through * (1.0 - here * material_alpha(geometry, items))
        left = left & (through > LEAST)
        go_on(packet, load_row(packet, TFAR), limit)
    return through > LEAST, through


@inline
def dimmed(opacity, part, a):
    """A triple times the part of the light that passes; the triple where all is opaque."""
    if opacity is None:
        return a
    return scale(part, a)


@inline
def still_seeing(opacity, scratch, e, layer, there):
    """The mask of the viewing rays of packet e that see a `layer` of surfaces, which go on from the layer before.

    Args: layer: 0 for the first. there: the mask of those that see the first.
    """
    if opacity is None:
        return there
    kept = scratch.layers[e]
    if layer == 0:
        for column in range(layout.FILM):
            store_row(kept, column, 0.0)
        store_row(kept, layout.W, 1.0)
        store_row(kept, layout.SHADOW, 1.0)
        store_row(kept, layout.DEPTH, np.float32(np.inf))
        store_row(kept, THROUGH, select(there, 1.0, 0.0))
        store_row(kept, BEGIN, 0.0)
    store_row(scratch.packet, TNEAR, load_row(kept, BEGIN))
    return load_row(kept, THROUGH) > 0.0


@inline
def keep_hits(opacity, scratch, e, distance, cover):
    """Note where packet e goes on, and the alpha of what it has met."""
    if opacity is not None:
        store_row(scratch.layers[e], BEGIN, distance + STEP)
        store_row(scratch.layers[e], COVER, cover)


@inline
def composite(opacity, scratch, e, layers):
    """Put what packet e has met, or the background, behind what it met before; returns whether rays go on.

    Args: layers: whether all layers of a picture are wanted. Those that are no light are of the first surface behind
        which less than half of the light passes.
    """
    if opacity is None:
        return False
    entry, kept, items = scratch.entries[e], scratch.layers[e], load_row(scratch.items, e)
    through = load_row(kept, THROUGH)
    there, met = through > 0.0, (through > 0.0) & (items >= 0)
    part = through * select(met, load_row(kept, COVER), 1.0)
    for column in range(layout.AMBIENT, layout.W):
        light = select(there, part * load_row(entry, column), 0.0)
        store_row(kept, column, load_row(kept, column) + light)
    left = through - select(met, part * load_row(entry, layout.ALPHA), 0.0)
    left = select(left > LEAST, left, 0.0)
    if layers:
        shown = met & (through > HALF) & (left <= HALF)
        for column in range(layout.W, layout.FILM):
            store_row(kept, column, select(shown, load_row(entry, column), load_row(kept, column)))
    store_row(kept, layout.ALPHA, select(there, 1.0 - left, load_row(kept, layout.ALPHA)))
    going = met & (left > 0.0)
    store_row(kept, THROUGH, select(going, left, 0.0))
    return some(going)


@inline
def show_layers(opacity, scratch, packets):
    """Make the entries of the first packets what their rays have seen in all."""
    if opacity is not None:
        for e in range(packets):
            for column in range(layout.FILM):
                store_row(scratch.entries[e], column, load_row(scratch.layers[e], column))


@kernel
def mark_seen(geometry, view, columns, rows, packet, valid, seen, whole):
    """Set `seen`, bool (w,), for the vertices of all faces that a sample of some pixels meets.

    Args: columns, rows: of the pixels, (first, end). packet, valid: of `raytrace.embree.packets.new_packet`, sixteen.
        whole: also for all vertices of these faces' polygons.
    """
    left, right = columns
    for y in range(rows[0], rows[1]):
        for x in range(left, right, WIDE):
            pixels = lane_numbers() + x
            for sample in range(max(1, view.offsets.shape[2])):
                aim(packet, view, pixels, 0 * pixels + y, 0 * pixels + sample)
                there, through = pixels < right, single(double(0 * pixels + 1))
                while some(there):
                    items, faces, _, _, distance, cover = meet(geometry.opacity, geometry, packet, valid, there)
                    mark_corners(geometry, items, faces, seen, whole)
                    met = distance, cover
                    there, through = behind(geometry.opacity, geometry, packet, items, met, through)


@inline
def mark_corners(geometry, items, faces, seen, whole):
    """Set `seen` for the vertices of the faces that were met, rows of objects and of their shapes' faces in lanes."""
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
