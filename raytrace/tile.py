"""One tile of a picture: viewing rays in packets, their hits lit together, pixels that agree early retired early."""

from __future__ import annotations

from math import sqrt

import numpy as np

from .borrow import borrow
from .embree import DIR_X, DIR_Y, DIR_Z, GEOM_ID, ID, INVALID, LANES, TFAR, U, V, intersect8
from .entries import (
    AMBIENT,
    DEPTH,
    DIFFUSE,
    EMISSION,
    LIT,
    NORMAL,
    OBJECT,
    PIXEL,
    SENT,
    SPECULAR,
    TINT,
    W,
)
from .jit import inline, kernel
from .lighting import BACKGROUND, PRIMARY, RETIRED, count_directed, light_entries
from .models.dispatch import alpha
from .models.rows import MODEL
from .surface import GOURAUD, fill, vertex_entry
from .tint import apply_tint, tint
from .view import aim, load3, pixel_width, struck

TILE = 16  # pixels a side
FIRST = 4  # samples before a pixel may be retired
CAPACITY = TILE * TILE * FIRST  # entries lit together

# Columns of the film; the layers of `raytrace.frame` in their order. SUM_… are a pixel's float64 sums.
BEAUTY, FILM_AMBIENT, FILM_DIFFUSE, FILM_SPECULAR, FILM_EMISSION = 0, 4, 7, 10, 13
FILM_W, FILM_SHADOW, FILM_DEPTH, FILM_NORMAL, FILM_ALBEDO, FILM_ID = 16, 17, 18, 19, 22, 25
FILM = 26
ALPHA, SHADED, SAMPLES, LOW, HIGH = FILM, FILM + 1, FILM + 2, FILM + 3, FILM + 6
SUMS = FILM + 9
AGREE = 1.0 / 256.0  # of the square root of a linear value, about one step of an 8-bit picture


@inline
def spread(sums, p, q):
    """How far the samples of two pixels of the tile are apart, all together, in the square root of linear values."""
    widest = 0.0
    for c in range(3):
        high = max(sums[p, HIGH + c], sums[q, HIGH + c])
        widest = max(widest, sqrt(high) - sqrt(min(sums[p, LOW + c], sums[q, LOW + c])))
    return widest


@inline
def retired(sums, p, wide, pixels):
    """Whether a pixel's samples agree among themselves, and roughly with those of its neighbours in the tile."""
    if spread(sums, p, p) > AGREE:
        return False
    x = p % wide
    roughly = 4.0 * AGREE
    return not (
        (x > 0 and spread(sums, p, p - 1) > roughly)
        or (x + 1 < wide and spread(sums, p, p + 1) > roughly)
        or (p >= wide and spread(sums, p, p - wide) > roughly)
        or (p + wide < pixels and spread(sums, p, p + wide) > roughly)
    )


@inline
def develop(entry, geometry, sums, background, id_offset):
    """Add an entry, or the background where `id_offset` is zero, to its pixel's sums."""
    sums[SAMPLES] += 1.0
    colour = background
    if id_offset > 0:
        item = int(entry[OBJECT])
        material = geometry.rows[item]
        opacity = alpha(material)
        colour = (0.0, 0.0, 0.0)
        for part, column in ((AMBIENT, FILM_AMBIENT), (DIFFUSE, FILM_DIFFUSE), (SPECULAR, FILM_SPECULAR)):
            for c in range(3):
                sums[column + c] += entry[part + c]
            colour = (colour[0] + entry[part], colour[1] + entry[part + 1], colour[2] + entry[part + 2])
        for c in range(3):
            sums[FILM_EMISSION + c] += entry[EMISSION + c]
            sums[FILM_ALBEDO + c] += material[MODEL + c] * entry[TINT + c]
        colour = (colour[0] + entry[EMISSION], colour[1] + entry[EMISSION + 1], colour[2] + entry[EMISSION + 2])
        sums[ALPHA] += opacity
        sums[FILM_W] += entry[W]
        sums[FILM_SHADOW] += entry[LIT] / entry[SENT] if entry[SENT] > 0.0 else 1.0
        sums[SHADED] += 1.0
        if entry[DEPTH] < sums[FILM_DEPTH]:
            sums[FILM_DEPTH] = entry[DEPTH]
            sums[FILM_ID] = item + 1.0
            for c in range(3):
                sums[FILM_NORMAL + c] = entry[NORMAL + c]
    else:
        for c in range(3):
            sums[FILM_EMISSION + c] += background[c]
    for c in range(3):
        sums[LOW + c] = min(sums[LOW + c], colour[c])
        sums[HIGH + c] = max(sums[HIGH + c], colour[c])


@inline
def finish(sums, film, y, x, scale_of_world):
    """Turn a pixel's sums into its layers, float32; beauty is the float32 sum of the others."""
    share = 1.0 / sums[SAMPLES]
    for c in range(3):
        beauty = np.float32(sums[FILM_AMBIENT + c] * share)
        beauty = np.float32(beauty + np.float32(sums[FILM_DIFFUSE + c] * share))
        beauty = np.float32(beauty + np.float32(sums[FILM_SPECULAR + c] * share))
        film[y, x, BEAUTY + c] = np.float32(beauty + np.float32(sums[FILM_EMISSION + c] * share))
    film[y, x, BEAUTY + 3] = sums[ALPHA] * share
    if film.shape[2] > 4:
        for column in range(FILM_AMBIENT, FILM_W):
            film[y, x, column] = sums[column] * share
        shaded = max(sums[SHADED], 1.0)
        film[y, x, FILM_W] = sums[FILM_W] / shaded if sums[SHADED] > 0.0 else 1.0
        film[y, x, FILM_SHADOW] = sums[FILM_SHADOW] / shaded if sums[SHADED] > 0.0 else 1.0
        film[y, x, FILM_DEPTH] = sums[FILM_DEPTH] / scale_of_world
        film[y, x, FILM_ID] = sums[FILM_ID]
        for c in range(3):
            film[y, x, FILM_NORMAL + c] = sums[FILM_NORMAL + c]
            film[y, x, FILM_ALBEDO + c] = sums[FILM_ALBEDO + c] / shaded


@inline
def interpolate_lit(entry, geometry, item, face, u, v, vertex_light):
    """Gouraud: the entry's light is interpolated between its corners'."""
    row = geometry.first_face[item] + face
    own = geometry.first_w[item] - geometry.first_vertex[item]
    for column in range(AMBIENT, LIT + 1):
        total = 0.0
        for corner in range(3):
            weight = (1.0 - u - v) if corner == 0 else (u if corner == 1 else v)
            total += weight * vertex_light[own + geometry.faces[row, corner], column - AMBIENT]
        entry[column] = total


@kernel
def render_tiles(geometry, lights, textures, view, style, vertex_light, scratch, corner, span, scale, wanted, film):
    """Render the tiles [span[0], span[1]), counted along the rows of `film`, float32 (height, width, 4 or FILM).

    Args: vertex_light: float64 (n, 14), lit vertices for Gouraud shading; corner: (x, y) of the film in the whole
        picture; scale: of the world; wanted: int64 (textures,), set to 1 for every texture that was met but is not read
        yet: the tiles must be rendered again.
    """
    geometry, lights, textures, view = borrow(geometry), borrow(lights), borrow(textures), borrow(view)
    vertex_light, scratch, wanted, film = borrow(vertex_light), borrow(scratch), borrow(wanted), borrow(film)
    columns = -(-film.shape[1] // TILE)
    for tile in range(span[0], span[1]):
        x, y = tile % columns * TILE, tile // columns * TILE
        part = film[y : y + TILE, x : x + TILE]
        place = corner[0] + x, corner[1] + y
        render_tile(geometry, lights, textures, view, style, vertex_light, scratch, place, wanted, part)
        for p in range(part.shape[0] * part.shape[1]):
            finish(scratch.sums[p], part, p // part.shape[1], p % part.shape[1], scale)


@inline
def render_tile(geometry, lights, textures, view, style, vertex_light, scratch, place, wanted, film):
    """Gather the sums of one tile, `film`, whose first pixel is `place` of the whole picture."""
    wide = film.shape[1]
    pixels = film.shape[0] * wide
    sums, todo = scratch.sums, scratch.todo
    clear(sums, todo, pixels)
    pending, done = pixels, 0
    while pending > 0 and done < style.samples:
        batch = min(FIRST, style.samples - done)
        total = pending * batch
        for start in range(0, total, CAPACITY):
            stop = min(start + CAPACITY, total)
            count = 0
            for first in range(start, stop, LANES):
                turn = first, min(LANES, stop - first), batch, done
                count = cast(
                    geometry, lights, textures, view, style, vertex_light, scratch, place, wide, wanted, turn, count
                )
            if style.shading != GOURAUD and count > 0:
                light_entries(geometry, lights, style, scratch, count)
            for e in range(count):
                develop(scratch.entries[e], geometry, sums[int(scratch.entries[e, PIXEL])], style.background, 1)
        done += batch
        left = 0
        for k in range(pending):
            if done < style.samples and not retired(sums, todo[k], wide, pixels):
                todo[left] = todo[k]
                left += 1
        if done < style.samples:
            scratch.counts[RETIRED] += (pending - left) * (style.samples - done)
        pending = left


@inline
def clear(sums, todo, pixels):
    """Nothing gathered yet, everything to do."""
    sums[:] = 0.0
    for p in range(pixels):
        todo[p] = p
        sums[p, FILM_DEPTH] = np.inf
        for c in range(3):
            sums[p, LOW + c] = np.inf
            sums[p, HIGH + c] = -np.inf


@inline
def cast(geometry, lights, textures, view, style, vertex_light, scratch, place, wide, wanted, turn, count):
    """One packet of viewing rays; hits become entries from `count` on. Returns how many entries there are then.

    Args: turn: the packet's first sample and its number of samples, samples a pixel in this pass and before it.
    """
    first, lanes, batch, done = turn
    packet, valid, todo = scratch.packet, scratch.valid, scratch.todo
    for lane in range(LANES):
        valid[lane] = -1 if lane < lanes else 0
    for lane in range(lanes):
        p = todo[(first + lane) // batch]
        sample = done + (first + lane) % batch
        packet[ID, lane] = aim(packet, lane, view, place[0] + p % wide, place[1] + p // wide, sample)
    intersect8(geometry.handle, packet, valid)
    scratch.counts[PRIMARY] += lanes
    ids = packet.view(np.uint32)
    for lane in range(lanes):
        p = todo[(first + lane) // batch]
        if ids[GEOM_ID, lane] == INVALID:
            scratch.counts[BACKGROUND] += count_directed(lights)
            develop(scratch.entries[0], geometry, scratch.sums[p], style.background, 0)
            continue
        item, face = struck(ids, lane)
        u, v = np.float64(packet[U, lane]), np.float64(packet[V, lane])
        depth = np.float64(packet[ID, lane]) + packet[TFAR, lane]
        backward = -np.float64(packet[DIR_X, lane]), -np.float64(packet[DIR_Y, lane]), -np.float64(packet[DIR_Z, lane])
        entry = scratch.entries[count]
        fill(entry, geometry, item, face, u, v, depth, backward, style.shading, style.terminator)
        tint(entry, geometry, textures, wanted, item, face, u, v, pixel_width(view, depth))
        entry[PIXEL] = p
        if style.shading == GOURAUD:
            interpolate_lit(entry, geometry, item, face, u, v, vertex_light)
            apply_tint(entry)
        count += 1
    return count


@kernel
def light_vertices(geometry, lights, view, style, scratch, item, span, out):
    """Gouraud's first step: light the vertices [span[0], span[1]) of an object's stretch of `geometry.w`, into `out`.

    Args: out: float64 (w, 14), the columns AMBIENT to LIT of an entry.
    """
    geometry, lights, view, scratch, out = borrow(geometry), borrow(lights), borrow(view), borrow(scratch), borrow(out)
    entries = scratch.entries
    own = geometry.first_vertex[item] - geometry.first_w[item]
    for start in range(span[0], span[1], CAPACITY):
        stop = min(start + CAPACITY, span[1])
        for k in range(start, stop):
            entry = entries[k - start]
            vertex_entry(entry, geometry, item, own + k, load3(view.eye), load3(view.forward), view.orthographic)
            entry[W] = geometry.w[k]
        light_entries(geometry, lights, style, scratch, stop - start)
        for k in range(start, stop):
            for column in range(AMBIENT, LIT + 1):
                out[k, column - AMBIENT] = entries[k - start, column]
