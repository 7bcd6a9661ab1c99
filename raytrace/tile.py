"""One tile of a picture: viewing rays in packets, their hits lit together, pixels that agree early retired early."""

from __future__ import annotations

from math import sqrt

import numpy as np

from .borrow import borrow
from .embree import GEOM_ID, INVALID, LANES, TFAR, U, V, intersect8
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
from .vector import load
from .view import aim, load3, struck

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
def retired(sums):
    """Whether a pixel's samples agree to about a step of an 8-bit picture."""
    spread = 0.0
    for c in range(3):
        spread = max(spread, sqrt(sums[HIGH + c]) - sqrt(sums[LOW + c]))
    return spread <= AGREE


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
def render_tiles(
    geometry, lights, view, left, top, first, last, samples, shading, form, shadows, terminator, background,
    vertex_light, world_scale, packet, valid, entries, sums, todo, active, queue, light, film, counts,
):  # fmt: skip
    """Render the tiles [first, last), counted along the rows of `film`, float32 (height, width, 4 or FILM).

    Args: left, top: the film's place in the whole picture; vertex_light: float64 (n, 14), lit vertices for Gouraud
        shading; packet … light: scratch; counts: int64.
    """
    geometry, lights, view, vertex_light = borrow(geometry), borrow(lights), borrow(view), borrow(vertex_light)
    packet, valid, entries, sums, todo = borrow(packet), borrow(valid), borrow(entries), borrow(sums), borrow(todo)
    active, queue, light, film, counts = borrow(active), borrow(queue), borrow(light), borrow(film), borrow(counts)
    columns = -(-film.shape[1] // TILE)
    for tile in range(first, last):
        x, y = tile % columns * TILE, tile // columns * TILE
        render_tile(
            geometry, lights, view, left + x, top + y, samples, shading, form, shadows, terminator, background,
            vertex_light, world_scale, packet, valid, entries, sums, todo, active, queue, light,
            film[y : y + TILE, x : x + TILE], counts,
        )  # fmt: skip


@inline
def render_tile(
    geometry, lights, view, x0, y0, samples, shading, form, shadows, terminator, background, vertex_light, world_scale,
    packet, valid, entries, sums, todo, active, queue, light, film, counts,
):  # fmt: skip
    """Render one tile, `film`, whose first pixel is (x0, y0) of the whole picture."""
    wide = film.shape[1]
    pixels = film.shape[0] * wide
    ids = packet.view(np.uint32)
    starts, backs = np.empty(LANES), np.empty((LANES, 3))
    directed = count_directed(lights)
    sums[:] = 0.0
    for p in range(pixels):
        todo[p] = p
        sums[p, FILM_DEPTH] = np.inf
        for c in range(3):
            sums[p, LOW + c] = np.inf
            sums[p, HIGH + c] = -np.inf
    pending, done = pixels, 0
    while pending > 0 and done < samples:
        batch = min(FIRST, samples - done)
        total = pending * batch
        for start in range(0, total, CAPACITY):
            count = 0
            stop = min(start + CAPACITY, total)
            for first in range(start, stop, LANES):
                lanes = min(LANES, stop - first)
                for lane in range(LANES):
                    valid[lane] = -1 if lane < lanes else 0
                for lane in range(lanes):
                    p = todo[(first + lane) // batch]
                    sample = done + (first + lane) % batch
                    starts[lane], direction = aim(packet, lane, view, x0 + p % wide, y0 + p // wide, sample)
                    for axis in range(3):
                        backs[lane, axis] = -direction[axis]
                intersect8(geometry.handle, packet, valid)
                counts[PRIMARY] += lanes
                for lane in range(lanes):
                    p = todo[(first + lane) // batch]
                    if ids[GEOM_ID, lane] == INVALID:
                        counts[BACKGROUND] += directed
                        develop(entries[0], geometry, sums[p], background, 0)
                        continue
                    item, face = struck(ids, lane)
                    u, v = np.float64(packet[U, lane]), np.float64(packet[V, lane])
                    depth = starts[lane] + packet[TFAR, lane]
                    entry = entries[count]
                    fill(entry, geometry, item, face, u, v, depth, load(backs, lane), shading, terminator)
                    entry[PIXEL] = p
                    if shading == GOURAUD:
                        interpolate_lit(entry, geometry, item, face, u, v, vertex_light)
                    count += 1
            if shading != GOURAUD and count > 0:
                light_entries(
                    geometry, lights, entries, count, active, form, shadows, packet, valid, queue, light, counts
                )
            for e in range(count):
                develop(entries[e], geometry, sums[int(entries[e, PIXEL])], background, 1)
        done += batch
        left = 0
        for k in range(pending):
            if done < samples and not retired(sums[todo[k]]):
                todo[left] = todo[k]
                left += 1
        if done < samples:
            counts[RETIRED] += (pending - left) * (samples - done)
        pending = left
    for p in range(pixels):
        finish(sums[p], film, p // wide, p % wide, world_scale)


@kernel
def light_vertices(
    geometry, lights, eye, forward, orthographic, form, shadows, item, first, last, packet, valid, entries, active,
    queue, light, out, counts,
):  # fmt: skip
    """Gouraud's first step: light the vertices [first, last) of an object's stretch of `geometry.w`, into `out`.

    Args: out: float64 (w, 14), the columns AMBIENT to LIT of an entry.
    """
    geometry, lights, entries, packet, valid = (
        borrow(geometry), borrow(lights), borrow(entries), borrow(packet), borrow(valid)
    )  # fmt: skip
    active, queue, light, out, counts = borrow(active), borrow(queue), borrow(light), borrow(out), borrow(counts)
    own = geometry.first_vertex[item] - geometry.first_w[item]
    for start in range(first, last, CAPACITY):
        stop = min(start + CAPACITY, last)
        for k in range(start, stop):
            vertex_entry(entries[k - start], geometry, item, own + k, load3(eye), load3(forward), orthographic)
            entries[k - start, W] = geometry.w[k]
        light_entries(
            geometry, lights, entries, stop - start, active, form, shadows, packet, valid, queue, light, counts
        )
        for k in range(start, stop):
            for column in range(AMBIENT, LIT + 1):
                out[k, column - AMBIENT] = entries[k - start, column]
