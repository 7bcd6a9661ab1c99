"""From lit entries to pixels: samples are summed up, and pixels whose samples agree need no more."""

from __future__ import annotations

from math import sqrt

import numpy as np

from .entries import (
    ALBEDO,
    ALPHA,
    AMBIENT,
    BEAUTY,
    DEPTH,
    DIFFUSE,
    EMISSION,
    FILM,
    ID,
    NORMAL,
    SHADOW,
    SPECULAR,
    W,
    take,
)
from .jit import inline
from .lane_memory import load_row, scatter4, store_row
from .lanes import WIDE, pick
from .vector import add

_BITS = 4
TILE = 1 << _BITS  # pixels a side
# Columns of a pixel's float64 sums: those of an entry, and then
SHADED, SAMPLES, LOW, HIGH = FILM, FILM + 1, FILM + 2, FILM + 5
SUMS = FILM + 8
AGREE = 1.0 / 256.0  # of the square root of a linear value, about one step of an 8-bit picture


@inline
def clear(sums):
    """Nothing gathered yet."""
    sums[:] = 0.0
    sums[:, DEPTH] = np.inf
    sums[:, LOW : LOW + 3] = np.inf
    sums[:, HIGH : HIGH + 3] = -np.inf


@inline
def beauty(entry):
    """The sum of an entry's light, RGB."""
    return add(add(add(take(entry, AMBIENT), take(entry, DIFFUSE)), take(entry, SPECULAR)), take(entry, EMISSION))


@inline
def develop(entry, sums, pixels, batch, layers):
    """Add the first lanes of an entry, `batch` for each of `pixels`, to their sums."""
    colour = beauty(entry)
    for c in range(3):
        store_row(entry, BEAUTY + c, colour[c])
    for lane in range(len(pixels) * batch):
        sum_ = sums[pixels[lane // batch]]
        for column in range(ALPHA, W):
            sum_[column] += entry[column, lane]
        for c in range(3):
            sum_[LOW + c] = min(sum_[LOW + c], entry[BEAUTY + c, lane])
            sum_[HIGH + c] = max(sum_[HIGH + c], entry[BEAUTY + c, lane])
        sum_[SAMPLES] += 1.0
        if layers and entry[ID, lane] > 0.0:
            sum_[SHADED] += 1.0
            sum_[W] += entry[W, lane]
            sum_[SHADOW] += entry[SHADOW, lane]
            for c in range(3):
                sum_[ALBEDO + c] += entry[ALBEDO + c, lane]
            if entry[DEPTH, lane] < sum_[DEPTH]:
                sum_[DEPTH] = entry[DEPTH, lane]
                sum_[ID] = entry[ID, lane]
                for c in range(3):
                    sum_[NORMAL + c] = entry[NORMAL + c, lane]


@inline
def mean(sums, pixels, layers, entry):
    """Turn the sums of up to sixteen pixels into the lanes of an entry."""
    for lane in range(len(pixels)):
        sum_ = sums[pixels[lane]]
        share = 1.0 / sum_[SAMPLES]
        for column in range(ALPHA, W):
            entry[column, lane] = sum_[column] * share
        if layers:
            hit = sum_[SHADED] > 0.0
            share = 1.0 / max(sum_[SHADED], 1.0)
            entry[W, lane] = sum_[W] * share if hit else 1.0
            entry[SHADOW, lane] = sum_[SHADOW] * share if hit else 1.0
            for c in range(3):
                entry[ALBEDO + c, lane] = sum_[ALBEDO + c] * share
                entry[NORMAL + c, lane] = sum_[NORMAL + c]
            entry[DEPTH, lane] = sum_[DEPTH]
            entry[ID, lane] = sum_[ID]


@inline
def column_of(pixels):
    """Columns of pixels of a tile."""
    return pixels & (TILE - 1)


@inline
def row_of(pixels):
    """Rows of pixels of a tile."""
    return pixels >> _BITS


@inline
def finish(entry, pixels, wanted, scale_of_world, film, left, top):
    """Write the lanes `wanted` of an entry into the film, float32 (height, width, 4 or FILM).

    Args: pixels: of the tile, lanes; left, top: of the tile in the film.
    """
    _, width, channels = film.shape
    colour = beauty(entry)
    begin = (top * width + left) * channels
    places = (row_of(pixels) * width + column_of(pixels)) * channels
    scatter4(film, begin, places, wanted, (colour[0], colour[1], colour[2], load_row(entry, ALPHA)))
    if channels > AMBIENT:
        store_row(entry, DEPTH, load_row(entry, DEPTH) / scale_of_world)
        for lane in range(WIDE):
            if pick(wanted, lane):
                x, y = left + column_of(pick(pixels, lane)), top + row_of(pick(pixels, lane))
                for column in range(AMBIENT, FILM):
                    film[y, x, column] = entry[column, lane]


@inline
def spread(sums, p, q):
    """How far the samples of two pixels of the tile are apart, all together, in the square root of linear values."""
    widest = 0.0
    for c in range(3):
        high = max(sums[p, HIGH + c], sums[q, HIGH + c])
        widest = max(widest, sqrt(high) - sqrt(min(sums[p, LOW + c], sums[q, LOW + c])))
    return widest


@inline
def retired(sums, p, size):
    """Whether a pixel's samples agree among themselves, and roughly with those of its neighbours in the tile.

    Args: size: of the tile, (wide, high).
    """
    if spread(sums, p, p) > AGREE:
        return False
    x, y = column_of(p), row_of(p)
    roughly = 4.0 * AGREE
    return not (
        (x > 0 and spread(sums, p, p - 1) > roughly)
        or (x + 1 < size[0] and spread(sums, p, p + 1) > roughly)
        or (y > 0 and spread(sums, p, p - TILE) > roughly)
        or (y + 1 < size[1] and spread(sums, p, p + TILE) > roughly)
    )
