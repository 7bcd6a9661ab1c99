"""From lit points to pixels: sums of samples, and adaptive anti-aliasing: converged pixels get no more samples."""

from math import sqrt

import numpy as np

from ..kernel.jit import inline
from ..kernel.simd import WIDE, load_row, pick, scatter4, store_row
from ..kernel.vector import add
from . import layout
from .layout import load3

BITS = 4
TILE = 1 << BITS  # pixels a side; a pixel's number is row · TILE + column
LAST = TILE - 1
FIRST = 4  # samples before a pixel may be retired
BLURRED = 32  # the same through a lens, by which few of a pixel's samples see something far beside it
PACKETS = TILE * TILE * FIRST // WIDE  # lit together
# Columns of a pixel's float64 sums: the film's, and then
SHADED = layout.FILM
SAMPLES = layout.FILM + 1
LOW = layout.FILM + 2
HIGH = layout.FILM + 5
SUMS = layout.FILM + 8
EDGE = 7  # of a pixel on a tile's edge: LOW, HIGH, and 1 if it was retired
AGREE = 1.0 / 256.0  # of the square root of a linear value, about one step of an 8-bit picture
ROUGHLY = 4.0 * AGREE


@inline
def clear(sums):
    sums[:] = 0.0
    sums[:, layout.DEPTH] = np.inf
    sums[:, LOW : LOW + 3] = np.inf
    sums[:, HIGH : HIGH + 3] = -np.inf


@inline
def beauty(packet):
    """The sum of a packet's light, RGB."""
    matt = add(load3(packet, layout.AMBIENT), load3(packet, layout.DIFFUSE))
    return add(add(matt, load3(packet, layout.SPECULAR)), load3(packet, layout.EMISSION))


@inline
def accumulate(packet, sums, pixels, batch, layers):
    """Add the first lanes of a packet to the sums of `pixels`, `batch` lanes a pixel."""
    colour = beauty(packet)
    for c in range(3):
        store_row(packet, layout.BEAUTY + c, colour[c])
    for lane in range(len(pixels) * batch):
        sum_ = sums[pixels[lane // batch]]
        for column in range(layout.ALPHA, layout.W):
            sum_[column] += packet[column, lane]
        for c in range(3):
            sum_[LOW + c] = min(sum_[LOW + c], packet[layout.BEAUTY + c, lane])
            sum_[HIGH + c] = max(sum_[HIGH + c], packet[layout.BEAUTY + c, lane])
        sum_[SAMPLES] += 1.0
        if layers and packet[layout.ID, lane] > 0.0:
            sum_[SHADED] += 1.0
            sum_[layout.W] += packet[layout.W, lane]
            sum_[layout.SHADOW] += packet[layout.SHADOW, lane]
            for c in range(3):
                sum_[layout.ALBEDO + c] += packet[layout.ALBEDO + c, lane]
            if packet[layout.DEPTH, lane] < sum_[layout.DEPTH]:
                sum_[layout.DEPTH] = packet[layout.DEPTH, lane]
                sum_[layout.ID] = packet[layout.ID, lane]
                for c in range(3):
                    sum_[layout.NORMAL + c] = packet[layout.NORMAL + c, lane]


@inline
def mean(sums, pixels, layers, packet):
    """Write the means of up to sixteen pixels to the lanes of a packet."""
    for lane in range(len(pixels)):
        sum_ = sums[pixels[lane]]
        share = 1.0 / sum_[SAMPLES]
        for column in range(layout.ALPHA, layout.W):
            packet[column, lane] = sum_[column] * share
        if layers:
            hit = sum_[SHADED] > 0.0
            share = 1.0 / max(sum_[SHADED], 1.0)
            packet[layout.W, lane] = sum_[layout.W] * share if hit else 1.0
            packet[layout.SHADOW, lane] = sum_[layout.SHADOW] * share if hit else 1.0
            for c in range(3):
                packet[layout.ALBEDO + c, lane] = sum_[layout.ALBEDO + c] * share
                packet[layout.NORMAL + c, lane] = sum_[layout.NORMAL + c]
            packet[layout.DEPTH, lane] = sum_[layout.DEPTH]
            packet[layout.ID, lane] = sum_[layout.ID]


@inline
def write_pixels(packet, pixels, mask, film, left, top):
    """Write a packet's lanes where the mask is set to the film's `pixels` of the tile at (left, top)."""
    _, width, channels = film.pixels.shape
    colour = beauty(packet)
    begin = (top * width + left) * channels
    places = ((pixels >> BITS) * width + (pixels & LAST)) * channels
    scatter4(film.pixels, begin, places, mask, (colour[0], colour[1], colour[2], load_row(packet, layout.ALPHA)))
    if channels > layout.AMBIENT:
        store_row(packet, layout.DEPTH, load_row(packet, layout.DEPTH) / film.scale)
        for lane in range(WIDE):
            if pick(mask, lane):
                x = left + (pick(pixels, lane) & LAST)
                y = top + (pick(pixels, lane) >> BITS)
                for column in range(layout.AMBIENT, layout.FILM):
                    film.pixels[y, x, column] = packet[column, lane]


@inline
def sample_range(a, b):
    """Range of two pixels' samples together, the widest channel's, in square roots; a, b: sums from LOW on."""
    widest = 0.0
    for c in range(3):
        high = max(a[3 + c], b[3 + c])
        low = min(a[c], b[c])
        widest = max(widest, sqrt(np.float64(high)) - sqrt(np.float64(low)))
    return widest


@inline
def converged(sums, p, size):
    """Whether a pixel's samples agree, and roughly with its neighbours' in its tile of `size`, (wide, high)."""
    own = sums[p, LOW:]
    if sample_range(own, own) > AGREE:
        return False
    x = p & LAST
    y = p >> BITS
    return not (
        (x > 0 and sample_range(own, sums[p - 1, LOW:]) > ROUGHLY)
        or (x + 1 < size[0] and sample_range(own, sums[p + 1, LOW:]) > ROUGHLY)
        or (y > 0 and sample_range(own, sums[p - TILE, LOW:]) > ROUGHLY)
        or (y + 1 < size[1] and sample_range(own, sums[p + TILE, LOW:]) > ROUGHLY)
    )


@inline
def store_edge(sums, p, size, retired, edges):
    """Store a pixel on the tile's left, right, upper or lower edge in its `edges`, float32 (4, TILE, EDGE)."""
    x = p & LAST
    y = p >> BITS
    sides = (0, x == 0, y), (1, x == size[0] - 1, y), (2, y == 0, x), (3, y == size[1] - 1, x)
    for side, at_edge, place in sides:
        if at_edge:
            for c in range(6):
                edges[side, place, c] = sums[p, LOW + c]
            edges[side, place, 6] = 1.0 if retired else 0.0


@inline
def reopened(edges, tile, columns, p):
    """Whether a pixel was retired, but a neighbour in another tile is unlike it. Args: columns: tiles in a row."""
    x = p & LAST
    y = p >> BITS
    return (
        (x == 0 and tile % columns > 0 and unlike(edges[tile, 0, y], edges[tile - 1, 1, y]))
        or (x == TILE - 1 and tile % columns + 1 < columns and unlike(edges[tile, 1, y], edges[tile + 1, 0, y]))
        or (y == 0 and tile >= columns and unlike(edges[tile, 2, x], edges[tile - columns, 3, x]))
        or (y == TILE - 1 and tile + columns < len(edges) and unlike(edges[tile, 3, x], edges[tile + columns, 2, x]))
    )


@inline
def unlike(own, other):
    """Whether a pixel was retired that a neighbour is unlike; rows of `edges`."""
    return own[6] == 1.0 and sample_range(own, other) > ROUGHLY
