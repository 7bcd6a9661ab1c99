"""From lit points to pixels: sums of samples, and adaptive anti-aliasing: converged pixels get no more samples.

The film is divided into cells, squares between the centres of four pixels, and each keeps the range of all samples in
it, whosever they are. A pixel's filter reaches over the four cells around its centre: while they disagree it needs all
samples, which widen the ranges of other pixels' cells in turn. So what few samples meet, a wire far thinner than a
pixel or its blur, is followed from wherever one of them met it.
"""

from math import sqrt

import numpy as np

from ..kernel.jit import inline
from ..kernel.simd import WIDE, load_row, pick, scatter4, store_row
from ..kernel.vector import add
from . import layout
from .camera_rays import offset_set
from .layout import load3

BITS = 4
TILE = 1 << BITS  # pixels a side; a pixel's number is row · TILE + column
LAST = TILE - 1
CELLS = TILE + 1  # a side of a tile; those on its rim are its neighbours' as well
FIRST = 4  # samples before a pixel may be retired
PACKETS = TILE * TILE * FIRST // WIDE  # lit together
# Columns of a pixel's float64 sums: the film's, and then
SHADED = layout.FILM
SAMPLES = layout.FILM + 1
SUMS = layout.FILM + 2
# Columns of a cell: the least and the largest of its samples, RGB, in square roots
HIGH = 3
RANGE = 6
MASKS = 4 * CELLS * RANGE  # of what tiles know of one another: cells on the four sides, then rows of retired pixels
EDGES = MASKS + TILE
AGREE = 2.5 / 256.0  # of the square root of a linear value, about two steps of an 8-bit picture


@inline
def clear(sums, cells):
    """Begin a tile: ranges of `cells` that hold nothing, `sums` of 0, depth infinite."""
    cells[:, :HIGH] = np.inf
    cells[:, HIGH:] = -np.inf
    sums[:] = 0.0
    sums[:, layout.DEPTH] = np.inf


@inline
def beauty(packet):
    """The sum of a packet's light, RGB."""
    matt = add(load3(packet, layout.AMBIENT), load3(packet, layout.DIFFUSE))
    return add(add(matt, load3(packet, layout.SPECULAR)), load3(packet, layout.EMISSION))


@inline
def accumulate(packet, sums, pixels, batch, layers):
    """Add the first lanes of a packet to the sums of `pixels`, `batch` lanes a pixel."""
    for lane in range(len(pixels) * batch):
        sum_ = sums[pixels[lane // batch]]
        for column in range(layout.ALPHA, layout.W):
            sum_[column] += packet[column, lane]
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
def widen(packet, cells, pixels, view, corner, samples):
    """Widen the ranges of cells by the first lanes of a packet.

    Args: corner: of the tile in the picture. samples: of each of the `pixels` the first one's number, and how many.
    """
    colour = beauty(packet)
    for c in range(3):
        store_row(packet, layout.BEAUTY + c, sqrt(colour[c]))
    done, batch = samples
    for k in range(len(pixels)):
        x = pixels[k] & LAST
        y = pixels[k] >> BITS
        offsets = view.offsets[offset_set(view, x + corner[0], y + corner[1])]
        for i in range(batch):
            right = x + (offsets[0, done + i] >= 0.0)
            cell = cells[(y + (offsets[1, done + i] >= 0.0)) * CELLS + right]
            for c in range(3):
                value = packet[layout.BEAUTY + c, k * batch + i]
                cell[c] = min(cell[c], value)
                cell[HIGH + c] = max(cell[HIGH + c], value)


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
def converged(cells, p):
    """Whether all samples in the reach of a pixel's filter agree."""
    at = (p >> BITS) * CELLS + (p & LAST)
    widest = 0.0
    for c in range(3):
        low = min(min(cells[at, c], cells[at + 1, c]), min(cells[at + CELLS, c], cells[at + CELLS + 1, c]))
        h = HIGH + c
        high = max(max(cells[at, h], cells[at + 1, h]), max(cells[at + CELLS, h], cells[at + CELLS + 1, h]))
        widest = max(widest, high - low)
    return widest <= AGREE


@inline
def side(x, y):
    """The place of a tile's cell (x, y) in its `edges`, −1 if the cell is on no side."""
    if y % TILE == 0:
        return (y // TILE * CELLS + x) * RANGE
    if x % TILE == 0:
        return ((2 + x // TILE) * CELLS + y) * RANGE
    return -1


@inline
def store_edges(edges, cells, retired):
    """Store what others need of a tile, `edges` (EDGES,): the cells on its sides, and which pixels are retired."""
    for k in range(CELLS * CELLS):
        at = side(k % CELLS, k // CELLS)
        if at >= 0:
            for c in range(RANGE):
                edges[at + c] = cells[k, c]
    store_retired(edges, retired)


@inline
def store_retired(edges, retired):
    """Store which pixels of a tile are retired, a row in the bits of a number each."""
    for y in range(TILE):
        bits = np.int64(0)
        for x in range(TILE):
            bits |= np.int64(retired[y << BITS | x]) << x
        edges[MASKS + y] = bits


@inline
def load_edges(edges, tile, columns, cells, retired):
    """Load which pixels of a tile are retired, and the cells on its sides, merged with those of the eight tiles
    around it.

    Args:
        edges: (tiles, EDGES), in rows of `columns`, as tiles have stored them after rendering their own pixels.
        cells, retired: written.
    """
    for p in range(TILE * TILE):
        retired[p] = np.int64(edges[tile, MASKS + (p >> BITS)]) >> (p & LAST) & 1
    for down in range(-1, 2):
        for right in range(-1, 2):
            column = tile % columns + right
            row = tile // columns + down
            if 0 <= column < columns and 0 <= row < len(edges) // columns:
                widen_sides(cells, edges[row * columns + column], right, down)


@inline
def widen_sides(cells, edges, right, down):
    """Widen the cells that a tile shares with the one so many tiles further right and down, which has these `edges`."""
    for k in range(CELLS * CELLS):
        x = k % CELLS - right * TILE
        y = k // CELLS - down * TILE
        if 0 <= x <= TILE and 0 <= y <= TILE and side(x, y) >= 0:
            at = side(x, y)
            for c in range(3):
                cells[k, c] = min(cells[k, c], edges[at + c])
                cells[k, HIGH + c] = max(cells[k, HIGH + c], edges[at + HIGH + c])
