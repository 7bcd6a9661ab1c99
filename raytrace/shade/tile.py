"""One tile of a picture: viewing rays in packets, their hits lit together, converged pixels retired early.

A pixel's first few samples decide together with its neighbours' whether it needs more. Neighbours in other tiles are
known only when all tiles have been rendered, so pixels that one of them is unlike are taken up again then.
"""

import numpy as np

from ..brdf.layout import ALPHA, MODEL
from ..embree.packets import DIR_X, TNEAR
from ..kernel.arrays import unrefcounted_view
from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, count, double, gather, lane_numbers, load_row, pick, select, single, some, store_row
from ..kernel.vector import multiply, scale, triple
from ..materials.alpha_filter import MET_ALPHA, STEP
from . import layout
from .camera_rays import aim
from .film import (
    BITS,
    BLURRED,
    FIRST,
    LAST,
    TILE,
    accumulate,
    clear,
    converged,
    mean,
    reopened,
    store_edge,
    write_pixels,
)
from .gouraud import interpolate_lit
from .interaction import GOURAUD, PacketHits, next_object, write_hits, write_polygons
from .layout import BACKGROUND, BEGIN, COVER, NEXT, PRIMARY, RETIRED, load3, store1, store3
from .lighting import light_packets
from .texturing import map_albedo, map_grain, map_occlusion
from .transparency import begin_layers, closest_hits, composite


@kernel
def render_tiles(scene, view, style, film, scratch, span, again):
    """Render the tiles [span[0], span[1]), counted along the rows of the film: a few samples of all pixels of a tile,
    then more of the pixels whose samples don't agree.

    Textures whose `scratch.missing` is set afterwards are to be read, and the tiles to be rendered once more.

    Args: again: only the pixels that need all samples after all, by the `edges` that a first call for all tiles wrote.
    """
    scene = unrefcounted_view(scene)
    view = unrefcounted_view(view)
    film = unrefcounted_view(film)
    scratch = unrefcounted_view(scratch)
    todo = scratch.todo
    points = scratch.points if scene.geometry.opacity is None else scratch.layers
    columns = -(-film.pixels.shape[1] // TILE)
    first = FIRST if view.lens == 0.0 else BLURRED  # samples of every pixel
    for tile in range(span[0], span[1]):
        left = tile % columns * TILE
        top = tile // columns * TILE
        size = min(TILE, film.pixels.shape[1] - left), min(TILE, film.pixels.shape[0] - top)
        pending = list_pixels(scratch, size, film.edges, tile, columns, again)
        if again:
            scratch.counts[RETIRED] -= pending * (style.samples - first)

        # a few samples at a time, of the pixels that want more
        for done in range(0, style.samples, FIRST):
            if pending == 0:
                break
            batch = min(FIRST, style.samples - done)
            of_packet = WIDE // batch  # pixels a packet, all samples of a pixel on end
            packets = -(-pending // of_packet)
            corner = film.left + left, film.top + top
            trace_samples(scene, view, style, scratch, corner, (pending, packets), (done, batch))
            if style.samples > 1:
                if done == 0:
                    clear(scratch.sums)
                for e in range(packets):
                    k = e * of_packet
                    accumulate(points[e], scratch.sums, todo[k : min(k + of_packet, pending)], batch, style.layers)
                if done + FIRST == first < style.samples and not again:
                    pending = remove_converged(scratch, size, pending, style.samples - first, film.edges[tile])

        # all pixels that have got samples in this call
        taken = pending if again else list_pixels(scratch, size, film.edges, tile, columns, False)
        for k in range(0, taken, WIDE):
            packet = points[k // WIDE]  # with one sample a pixel, its lanes are the pixels
            if style.samples > 1:
                mean(scratch.sums, todo[k : min(k + WIDE, taken)], style.layers, packet)
            write_pixels(packet, load_row(todo, k // WIDE), lane_numbers() < taken - k, film, left, top)


@kernel
def mark_reopened(film, scratch, marks):
    """Mark the pixels that `render_tiles` would render again: `marks`, bool (tiles, TILE · TILE)."""
    film = unrefcounted_view(film)
    scratch = unrefcounted_view(scratch)
    marks = unrefcounted_view(marks)
    high, wide, _ = film.pixels.shape
    columns = -(-wide // TILE)
    for tile in range(len(film.edges)):
        size = min(TILE, wide - tile % columns * TILE), min(TILE, high - tile // columns * TILE)
        for k in range(list_pixels(scratch, size, film.edges, tile, columns, True)):
            marks[tile, scratch.todo[k]] = True


@inline
def list_pixels(scratch, size, edges, tile, columns, again):
    """List a tile's pixels as `todo`, `again` those that a neighbour in another tile reopens; returns how many."""
    left = 0
    for k in range(TILE * TILE):
        p = scratch.order[k]
        scratch.todo[left] = p
        left += p % TILE < size[0] and p // TILE < size[1] and (not again or reopened(edges, tile, columns, p))
    return left


@inline
def remove_converged(scratch, size, pending, remaining, edges):
    """Remove converged pixels from the list `todo` and fill the tile's `edges`; returns how many are left."""
    left = 0
    for k in range(pending):
        p = scratch.todo[k]
        retired = converged(scratch.sums, p, size)
        store_edge(scratch.sums, p, size, retired, edges)
        scratch.todo[left] = p
        left += not retired
    scratch.counts[RETIRED] += (pending - left) * remaining
    return left


@inline
def trace_samples(scene, view, style, scratch, corner, work, samples):
    """Trace and light samples of the pixels on the list `todo`, surface by surface from front to back.

    Args: work: number of pixels, and of packets for them. samples: the first, and how many of each pixel.
    """
    pending, packets = work
    done, batch = samples
    of_packet = WIDE // batch
    opacity = scene.geometry.opacity
    traced = packets
    if opacity is not None:
        begin_layers(scratch, packets)
    while traced > 0:  # once, where all surfaces are opaque
        for e in range(traced):
            numbers = lane_numbers() + e * WIDE  # of viewing rays, −1 for none
            if opacity is not None:
                numbers = load_row(scratch.active_rays, e)
            # The pixel and the sample of each ray.
            turn = ((numbers & (WIDE - 1)) * (256 // batch + 1)) >> 8  # number // batch, in a packet
            row = turn + (numbers >> 4) * of_packet  # of the pixel on the list
            there = (numbers >= 0) & (turn < of_packet) & (row < pending)
            pixels = gather(scratch.todo, select(there, row, 0))
            sample = (numbers & (WIDE - 1)) - turn * batch + done
            x = (pixels & LAST) + corner[0]
            y = (pixels >> BITS) + corner[1]
            # The rays, and what they hit.
            start = aim(scratch.rays, view, x, y, select(there, sample, 0), scene.geometry.farthest)
            if opacity is not None:  # rays start behind the layers that they have seen
                for lane in range(WIDE):
                    ray = max(pick(numbers, lane), 0)
                    scratch.rays[TNEAR, lane] = scratch.layers[ray // WIDE, BEGIN, ray % WIDE]
            items = trace_packet(scene, view, style, scratch, e, start, there)
            store_row(scratch.items, e, items)
            scratch.counts[PRIMARY] += count(there)
            scratch.counts[BACKGROUND] += count(there & (items < 0)) * len(scene.lights.kinds)
        if style.shading != GOURAUD:
            light_packets(scene.geometry, scene.lights, style, scratch, traced)
        traced = 0 if opacity is None else composite(scratch, traced, style.layers)


@inline
def trace_packet(scene, view, style, scratch, e, start, there):
    """Trace the viewing rays `scratch.rays`, `start` from the viewer, where the mask `there` is set; the hits become
    packet e. Returns the rows of the objects hit, −1 for none."""
    geometry = scene.geometry
    rays = scratch.rays
    packet = scratch.points[e]
    items, faces, u, v, distance = closest_hits(geometry, rays, scratch.valid, there)
    if geometry.opacity is not None:  # where the rays would go on, and the alpha of what they hit
        store_row(scratch.layers[e], NEXT, distance + STEP)
        store_row(scratch.layers[e], COVER, load_row(rays, MET_ALPHA))
    # What a ray that hits nothing leaves: the background, fully lit.
    for column in range(layout.BEAUTY, layout.FILM if style.layers else layout.W):
        store_row(packet, column, 1.0 if layout.W <= column <= layout.SHADOW else 0.0)
    for c in range(3):
        store_row(packet, layout.EMISSION + c, style.background[c])
    store_row(packet, layout.UNSHADOWED, 0.0)
    store_row(packet, layout.SHADOWED, 0.0)
    # The hits, object by object.
    left = items >= 0
    depth = start + distance
    hits = PacketHits(faces, u, v, depth, scale(-1.0, load3(rays, DIR_X)))
    if style.layers:
        store_row(packet, layout.DEPTH, select(left, depth, np.inf))
        store_row(packet, layout.ID, single(double(items + 1)))
    while some(left):
        item, mask = next_object(items, left)
        face_normal = write_hits(packet, scene, item, mask, hits, view, style)
        if len(geometry.polygons) > 0:
            write_polygons(packet, geometry, item, mask, hits, view, style, face_normal)
        map_albedo(packet, scene, item, mask, hits, view, scratch.missing)
        map_grain(packet, scene, item, mask, hits, view, scratch.missing)
        if style.weighted:
            map_occlusion(packet, scene, item, mask, hits, view, scratch.missing)
        material = geometry.materials[item]
        store1(packet, layout.ALPHA, mask, material[ALPHA])
        if style.layers:
            store3(packet, layout.ALBEDO, mask, multiply(load3(packet, layout.ALBEDO_MAP), triple(material, MODEL)))
        if style.shading == GOURAUD:
            interpolate_lit(packet, scene, item, mask, hits, style, face_normal)
        left = left & ~mask
    return items
