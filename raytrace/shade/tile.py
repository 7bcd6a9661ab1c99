"""One tile of a picture: viewing rays in packets, their hits lit together, pixels that agree retired early.

A pixel's first few samples decide together with its neighbours' whether it needs more. Neighbours in other tiles are
known only when all tiles have been rendered, so pixels that one of them is unlike are taken up again then.
"""

from __future__ import annotations

import numpy as np

from ..brdf.dispatch import alpha
from ..brdf.layout import MODEL
from ..embree.packets import DIR_X, TFAR, U, V, intersect16
from ..kernel.borrow import borrow
from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, double, select, single
from ..kernel.simd_masks import count, first, lane_numbers, pick, some
from ..kernel.simd_memory import gather, gather3, load_row, store_row
from ..kernel.vector import load3, multiply, scale
from .camera_rays import aim, pixel_width, struck
from .direct_lighting import count_directed, let_through, light_entries
from .film import TILE, add_background, agrees, clear, column_of, develop, finish, keep_edge, mean, recalled, row_of
from .interaction import GOURAUD, between, fill, vertex_entry
from .shading_points import (
    ALBEDO,
    ALPHA,
    AMBIENT,
    BEAUTY,
    DEPTH,
    EMISSION,
    FILM,
    ID,
    LIT,
    SENT,
    SHADOW,
    TINT,
    W,
    put,
    put1,
    take,
)
from .texturing import apply_tint, tint
from .workspace import BACKGROUND, FIRST, PACKETS, PRIMARY, RETIRED


@kernel
def render_tiles(
    geometry, lights, textures, view, style, vertex_light, scratch, corner, span, scale, wanted, film, edges, again
):
    """Render the tiles [span[0], span[1]), counted along the rows of `film`, float32 (height, width, 4 or FILM).

    Args: vertex_light: float64 (n, 14), lit vertices for Gouraud shading; corner: (x, y) of the film in the whole
        picture; scale: of the world; wanted: int64 (textures,), set to 1 for every texture that was met but is not read
        yet: the tiles must be rendered again. edges: float32 (tiles, 4, TILE, EDGE), what tiles know of one another,
        written by a first call for all tiles; again: only the pixels that those tell to need all samples after all.

    A few samples of all pixels of a tile come first, then more of those that don't agree.
    """
    geometry, lights, textures, view = borrow(geometry), borrow(lights), borrow(textures), borrow(view)
    vertex_light, scratch, wanted, film = borrow(vertex_light), borrow(scratch), borrow(wanted), borrow(film)
    edges = borrow(edges)
    scene = geometry, lights, textures, view, style, vertex_light
    entries, todo, counts, directed = scratch.entries, scratch.todo, scratch.counts, count_directed(lights)
    columns = -(-film.shape[1] // TILE)
    for tile in range(span[0], span[1]):
        left, top = tile % columns * TILE, tile // columns * TILE
        size = min(TILE, film.shape[1] - left), min(TILE, film.shape[0] - top)
        pending = list_recalled(scratch, size, edges, tile, columns) if again else list_pixels(scratch, size)
        if again:
            scratch.counts[RETIRED] -= pending * (style.samples - FIRST)
        for done in range(0, style.samples, FIRST):
            batch = min(FIRST, style.samples - done)
            each = WIDE // batch  # pixels a packet, all samples of a pixel on end
            turn = (lane_numbers() * (256 // batch + 1)) >> 8  # lane // batch
            packets = -(-pending // each)
            if pending == 0:
                break
            for e in range(packets):
                there = turn < min(each, pending - e * each)
                pixels = gather(todo, select(there, turn, 0) + e * each)
                x, y = column_of(pixels) + (corner[0] + left), row_of(pixels) + (corner[1] + top)
                items = cast(scene, scratch, entries[e], x, y, lane_numbers() - turn * batch + done, there, wanted)
                store_row(scratch.items, e, items)
                counts[PRIMARY] += count(there)
                counts[BACKGROUND] += count(there & (items < 0)) * directed
            if style.shading != GOURAUD:
                light_entries(geometry, lights, style, scratch, packets)
            for e in range(packets):
                add_background(entries[e], load_row(scratch.items, e), style.background)
            if style.samples > 1:
                if done == 0:
                    clear(scratch.sums)
                for e in range(packets):
                    k = e * each
                    develop(entries[e], scratch.sums, todo[k : min(k + each, pending)], batch, style.layers)
                if done == 0 and style.samples > FIRST and not again:
                    pending = keep(scratch, size, pending, style.samples - FIRST, edges[tile])
        taken = pending if again else list_pixels(scratch, size)
        for k in range(0, taken, WIDE):
            entry = entries[k // WIDE]  # with one sample a pixel that is the pixel
            if style.samples > 1:
                mean(scratch.sums, todo[k : min(k + WIDE, taken)], style.layers, entry)
            finish(entry, load_row(todo, k // WIDE), lane_numbers() < taken - k, scale, film, left, top)


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
def list_recalled(scratch, size, edges, tile, columns):
    """Put the pixels of a tile that need more samples for a neighbour in another tile on the list; returns how many."""
    left = 0
    for k in range(TILE * TILE):
        p = scratch.order[k]
        if p % TILE < size[0] and p // TILE < size[1] and recalled(edges, tile, columns, p):
            scratch.todo[left] = p
            left += 1
    return left


@inline
def keep(scratch, size, pending, remaining, edges):
    """Strike the pixels that need none of the remaining samples off the list; returns how many still do.

    Args: edges: of the tile, filled for its neighbours.
    """
    left = 0
    for k in range(pending):
        p = scratch.todo[k]
        retired = agrees(scratch.sums, p, size)
        keep_edge(scratch.sums, p, size, retired, edges)
        scratch.todo[left] = p
        left += not retired
    scratch.counts[RETIRED] += (pending - left) * remaining
    return left


@inline
def cast(scene, scratch, entry, x, y, samples, there, wanted):
    """One packet of viewing rays, where the mask `there` is set; the hits become an entry.

    Returns the rows of the objects that were hit, −1 for none.
    """
    geometry, _, textures, view, style, vertex_light = scene
    packet = scratch.packet
    start = aim(packet, view, x, y, samples)
    store_row(scratch.valid, 0, there)
    intersect16(geometry.handle, packet, scratch.valid)
    items, faces = struck(packet)
    items = select(there, items, -1)
    blank(entry, style)
    left = items >= 0
    depth = start + load_row(packet, TFAR)
    u, v = load_row(packet, U), load_row(packet, V)
    backward = scale(-1.0, take(packet, DIR_X))
    if style.layers:
        store_row(entry, DEPTH, select(left, depth, np.inf))
        store_row(entry, ID, single(double(items + 1)))
    while some(left):
        item = pick(items, first(left))
        mine = left & (items == item)
        fill(entry, geometry, item, mine, faces, u, v, backward, view, style)
        tint(entry, geometry, textures, wanted, item, mine, faces, u, v, pixel_width(view, depth))
        material = geometry.rows[item]
        put1(entry, ALPHA, mine, alpha(material))
        if style.layers:
            put(entry, ALBEDO, mine, multiply(take(entry, TINT), load3(material[MODEL:])))
        if style.shading == GOURAUD:
            interpolate_lit(entry, geometry, item, mine, faces, u, v, vertex_light)
            apply_tint(entry, mine)
        left = left & ~mine
    return items


@inline
def blank(entry, style):
    """An entry that has met nothing but the background."""
    for column in range(BEAUTY, EMISSION):
        store_row(entry, column, 0.0)
    for c in range(3):
        store_row(entry, EMISSION + c, style.background[c])
    store_row(entry, SENT, 0.0)
    store_row(entry, LIT, 0.0)
    if style.layers:
        for column in range(W, FILM):
            store_row(entry, column, 1.0 if column <= SHADOW else 0.0)


@inline
def interpolate_lit(entry, geometry, item, mine, faces, u, v, vertex_light):
    """Gouraud: the light of hits is interpolated between their faces' corners'."""
    i, j, k = gather3(geometry.faces, select(mine, faces, 0) + geometry.first_face[item])
    own = geometry.first_w[item] - geometry.first_vertex[item]
    width = vertex_light.shape[1]
    for column in range(width):
        at = column + own * width
        a, b = gather(vertex_light, i * width + at), gather(vertex_light, j * width + at)
        c = gather(vertex_light, k * width + at)
        put1(entry, lit_column(column), mine, single(between(a, b, c, u, v)))
    put1(entry, SHADOW, mine, let_through(load_row(entry, SENT), load_row(entry, LIT)))


@inline
def lit_column(number):
    """The columns that lighting makes, one after the other: AMBIENT to EMISSION, SENT and LIT."""
    return AMBIENT + number if number < W - AMBIENT else SENT + number - (W - AMBIENT)


@kernel
def light_vertices(geometry, lights, view, style, scratch, origins, item, span, out):
    """Gouraud's first step: light the vertices [span[0], span[1]) of an object's stretch of `geometry.w`, into `out`.

    Args: origins: see `raytrace.shade.interaction.vertex_entry`; out: float64 (w, 14), the columns of `lit_column`.
    """
    geometry, lights, view = borrow(geometry), borrow(lights), borrow(view)
    scratch, origins, out = borrow(scratch), borrow(origins), borrow(out)
    for begin in range(span[0], span[1], PACKETS * WIDE):
        packets = -(-min(PACKETS * WIDE, span[1] - begin) // WIDE)
        for e in range(packets):
            entry, k = scratch.entries[e], begin + e * WIDE
            mine = lane_numbers() < span[1] - k
            at = select(mine, lane_numbers(), 0) + k
            vertex_entry(entry, geometry, origins, item, mine, at, view)
            store_row(entry, W, single(gather(geometry.w, at)))
            store_row(scratch.items, e, select(mine, item, -1))
        light_entries(geometry, lights, style, scratch, packets)
        for e in range(packets):
            for lane in range(min(WIDE, span[1] - begin - e * WIDE)):
                for column in range(out.shape[1]):
                    out[begin + e * WIDE + lane, column] = scratch.entries[e, lit_column(column), lane]
