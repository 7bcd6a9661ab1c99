"""One tile of a picture: viewing rays in packets, their hits lit together, converged pixels retired early.

A pixel's first few samples decide together with its neighbours' whether it needs more. Neighbours in other tiles are
known only when all tiles have been rendered, so pixels that one of them is unlike are taken up again then.
"""

import numpy as np

from ..brdf.dispatch import alpha
from ..brdf.layout import MODEL
from ..embree.packets import DIR_X
from ..kernel.borrow import borrow
from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, double, select, single
from ..kernel.simd_masks import count, first, lane_numbers, pick, some
from ..kernel.simd_memory import gather, load_row, store_row
from ..kernel.vector import load3, multiply, scale
from . import shading_points as layout
from .camera_rays import aim
from .direct_lighting import count_directed, light_entries
from .film import (
    TILE,
    accumulate,
    clear,
    column_of,
    converged,
    mean,
    reopened,
    row_of,
    store_edge,
    write_pixels,
)
from .gouraud import interpolate_lit
from .interaction import GOURAUD, Hits, bent_entry, hit_entry
from .polygons import polygon_entry
from .records import borrow_scene
from .see_through import begin_behind, begin_layers, composite, keep_hits, meet, ray_numbers, seen_entries
from .shading_points import put, put1, take
from .texturing import apply_occlusion, apply_tint, texture_grain, texture_occlusion, texture_tint, vertex_tint
from .workspace import BACKGROUND, FIRST, PRIMARY, RETIRED


@kernel
def render_tiles(scene, view, style, film, scratch, span, again):
    """Render the tiles [span[0], span[1]), counted along the rows of the film.

    Where `scratch.missing` is set afterwards, those textures are to be read and the tiles to be rendered once more.

    Args: scene, view, style, film, scratch: `SceneArrays`, `View`, `Style`, `Film`, `Scratch`. again: only the pixels
        that need all samples after all, by the `edges` that a first call for all tiles has written.

    A few samples of all pixels of a tile come first, then more of those that don't agree.
    """
    scene, view, film, scratch = borrow_scene(scene), borrow(view), borrow(film), borrow(scratch)
    todo, counts, directed = scratch.todo, scratch.counts, count_directed(scene.lights)
    opacity = scene.geometry.opacity
    entries = seen_entries(opacity, scratch)
    high, wide, _ = film.pixels.shape
    columns = -(-wide // TILE)
    for tile in range(span[0], span[1]):
        left, top = tile % columns * TILE, tile // columns * TILE
        size = min(TILE, wide - left), min(TILE, high - top)
        pending = list_reopened(scratch, size, film.edges, tile, columns) if again else list_pixels(scratch, size)
        if again:
            scratch.counts[RETIRED] -= pending * (style.samples - FIRST)
        for done in range(0, style.samples, FIRST):
            batch = min(FIRST, style.samples - done)
            each = WIDE // batch  # pixels a packet, all samples of a pixel on end
            packets = -(-pending // each)
            if pending == 0:
                break
            traced = begin_layers(opacity, scratch, packets)
            while traced > 0:  # surfaces front to back: once, where all are opaque
                for e in range(traced):
                    numbers = ray_numbers(opacity, scratch, e)
                    turn = ((numbers & (WIDE - 1)) * (256 // batch + 1)) >> 8  # number // batch, in a packet
                    place = turn + (numbers >> 4) * each
                    there = (numbers >= 0) & (turn < each) & (place < pending)
                    pixels = gather(todo, select(there, place, 0))
                    x, y = column_of(pixels) + (film.left + left), row_of(pixels) + (film.top + top)
                    samples = (numbers & (WIDE - 1)) - turn * batch + done
                    start = aim(scratch.packet, view, x, y, select(there, samples, 0), scene.geometry.farthest)
                    begin_behind(opacity, scratch, numbers)
                    items = trace_packet(scene, view, style, scratch, e, start, there)
                    store_row(scratch.items, e, items)
                    counts[PRIMARY] += count(there)
                    counts[BACKGROUND] += count(there & (items < 0)) * directed
                if style.shading != GOURAUD:
                    light_entries(scene.geometry, scene.lights, style, scratch, traced)
                traced = composite(opacity, scratch, traced, style.layers)
            if style.samples > 1:
                if done == 0:
                    clear(scratch.sums)
                for e in range(packets):
                    k = e * each
                    accumulate(entries[e], scratch.sums, todo[k : min(k + each, pending)], batch, style.layers)
                if done == 0 and style.samples > FIRST and not again:
                    pending = remove_converged(scratch, size, pending, style.samples - FIRST, film.edges[tile])
        taken = pending if again else list_pixels(scratch, size)
        for k in range(0, taken, WIDE):
            entry = entries[k // WIDE]  # with one sample a pixel that is the pixel
            if style.samples > 1:
                mean(scratch.sums, todo[k : min(k + WIDE, taken)], style.layers, entry)
            write_pixels(entry, load_row(todo, k // WIDE), lane_numbers() < taken - k, film, left, top)


@kernel
def mark_reopened(film, scratch, marks):
    """Mark the pixels that `render_tiles` would render again: `marks`, bool (tiles, TILE · TILE)."""
    film, scratch, marks = borrow(film), borrow(scratch), borrow(marks)
    high, wide, _ = film.pixels.shape
    columns = -(-wide // TILE)
    for tile in range(len(film.edges)):
        size = min(TILE, wide - tile % columns * TILE), min(TILE, high - tile // columns * TILE)
        for k in range(list_reopened(scratch, size, film.edges, tile, columns)):
            marks[tile, scratch.todo[k]] = True


@inline
def list_pixels(scratch, size):
    """Put all pixels of a tile of this size, (wide, high), on the list `todo`; returns how many."""
    left = 0
    for k in range(TILE * TILE):
        p = scratch.order[k]
        scratch.todo[left] = p
        left += p % TILE < size[0] and p // TILE < size[1]
    return left


@inline
def list_reopened(scratch, size, edges, tile, columns):
    """Put the pixels of a tile that need more samples for a neighbour in another tile on the list; returns how many."""
    left = 0
    for k in range(TILE * TILE):
        p = scratch.order[k]
        if p % TILE < size[0] and p // TILE < size[1] and reopened(edges, tile, columns, p):
            scratch.todo[left] = p
            left += 1
    return left


@inline
def remove_converged(scratch, size, pending, remaining, edges):
    """Remove converged pixels from the list `todo`; returns how many are left to get the remaining samples.

    Args: edges: of the tile, filled for its neighbours.
    """
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
def trace_packet(scene, view, style, scratch, e, start, there):
    """Trace the viewing rays of `scratch.packet`, where the mask `there` is set; the hits become entry e.

    Args: start: distance from the viewer at which the rays begin. Returns the rows of the objects hit, −1 for none.
    """
    geometry, packet, entry = scene.geometry, scratch.packet, scratch.entries[e]
    items, faces, u, v, distance = meet(geometry.opacity, geometry, packet, scratch.valid, there)
    keep_hits(geometry.opacity, scratch, e, distance)
    clear_entry(entry, style)
    left = items >= 0
    depth = start + distance
    hits = Hits(faces, u, v, depth, scale(-1.0, take(packet, DIR_X)))
    if style.layers:
        store_row(entry, layout.DEPTH, select(left, depth, np.inf))
        store_row(entry, layout.ID, single(double(items + 1)))
    while some(left):
        item = pick(items, first(left))
        mask = left & (items == item)
        face_normal = hit_entry(entry, geometry, scene.w, item, mask, hits, view, style)
        if len(geometry.polygons) > 0:
            polygon_entry(entry, geometry, item, mask, hits, view, style, face_normal)
        bent_entry(entry, geometry, scene.bent, item, mask, hits)
        texture_tint(entry, scene, item, mask, hits, view, scratch.missing)
        vertex_tint(entry, geometry, item, mask, hits)
        texture_grain(entry, scene, item, mask, hits, view, scratch.missing)
        if style.weighted:
            texture_occlusion(entry, scene, item, mask, hits, view, scratch.missing)
        material = geometry.rows[item]
        put1(entry, layout.ALPHA, mask, alpha(material))
        if style.layers:
            put(entry, layout.ALBEDO, mask, multiply(take(entry, layout.TINT), load3(material[MODEL:])))
        if style.shading == GOURAUD:
            interpolate_lit(entry, scene, item, mask, hits, face_normal)
            apply_tint(entry, mask)
            if style.weighted:
                apply_occlusion(entry, mask, style.form)
        left = left & ~mask
    return items


@inline
def clear_entry(entry, style):
    """An entry that has met nothing but the background."""
    for column in range(layout.BEAUTY, layout.EMISSION):
        store_row(entry, column, 0.0)
    for c in range(3):
        store_row(entry, layout.EMISSION + c, style.background[c])
    store_row(entry, layout.SENT, 0.0)
    store_row(entry, layout.LIT, 0.0)
    if style.layers:
        for column in range(layout.W, layout.FILM):
            store_row(entry, column, 1.0 if column <= layout.SHADOW else 0.0)
