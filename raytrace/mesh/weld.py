"""Welding: vertices that a file stores apart, but that are one point of one surface, grouped."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..kernel.jit import kernel
from ..types import AnyInts, Float32s, Float64s, Int64s
from .components import connected_components, join, number
from .placement import contact_radius

CREASE = float(np.cos(np.radians(30.0)))  # coincident vertices whose faces differ by more stay apart: a hard edge
_NEIGHBOURS = 64
_CELLS = 2.0**15  # of a grid, along a unit of render space
_EDGE = 1.0 / 32.0  # of a cell: more than the largest contact radius
_FINE = 16.0  # contact radii; vertices all whose edges are shorter are welded only where they are equal


def weld(positions: Float32s, faces: Int64s, normals: Float64s, agreement: float) -> Int64s:
    """Group (n,) of each vertex: vertices at the same place whose normals agree share a group, numbered from 0.

    Args: positions (n, 3), faces (m, 3): as `coincident` takes them. normals (n, 3), unit or zero (agrees with none);
        agreement: the least cosine.
    """
    order, place = coincident(positions, faces)
    group = np.arange(len(positions))
    for a, b in _pairs(place):
        agree = np.einsum("ij,ij->i", normals[order[a]], normals[order[b]]) >= agreement
        join(np.stack([order[a[agree]], order[b[agree]]], axis=1), group)
    number(group)
    return group


def coincident(positions: Float32s, faces: Int64s) -> tuple[Int64s, Int64s]:
    """Rows (k,) of all `positions` (n, 3) that share a place, and perhaps of a few more, sorted by place.

    Positions share a place if they are equal or within their `contact_radius`, or are linked by others that are; but
    for vertices all whose edges are hardly longer than that, which must be equal.

    Args: positions: render space. faces: int64 (m, 3).

    Returns these and the number (k,) of each one's place, ascending from 0.
    """
    repeated = np.zeros(len(positions), np.bool_)
    for subset, keys in grids(positions):
        repeated[subset[_repeated(keys)]] = True
    rows = np.flatnonzero(repeated)
    x, y, z = (positions[rows] + np.float32(0.0)).T  # −0 becomes 0
    order = np.lexsort((z, y, x))
    new = np.zeros(len(rows), np.bool_)
    for coordinate in (x, y, z):
        new[1:] |= coordinate[order[1:]] != coordinate[order[:-1]]
    order = rows[order]
    place: Int64s = np.cumsum(new)
    links = _near(positions, faces, order[np.flatnonzero(np.diff(place, prepend=-1))])
    if len(links):
        place = connected_components(links, int(place[-1]) + 1)[place]
        again = np.lexsort((order, place))
        order, place = order[again], place[again]
    return order, place


def grids(positions: Float32s) -> Iterator[tuple[Int64s, Int64s]]:
    """Four grids of cells, each moved by a quarter: rows of `positions` (n, 3), and a key of each one's cell.

    Two positions within the contact radius share a key in one of them at least: along each axis they are parted by one
    grid at most. A grid has the rows near borders of all grids before it.
    """
    rows = np.arange(len(positions))
    for quarter in range(4):
        subset = positions[rows] if quarter else positions
        keys, beside = np.empty(len(rows), np.int64), np.empty(len(rows), np.bool_)
        _locate(subset, quarter / 4 + 0.1, keys, beside)  # no border is at 0, where many coordinates are
        yield rows, keys
        rows = rows[beside]


@kernel
def _locate(positions, shift, keys, beside):
    """The key (n,) of each position's cell, and whether it is near a border of that."""
    for i in range(len(positions)):
        key, near = 0, False
        for axis in range(3):
            size, steps = np.float64(abs(positions[i, axis])), 0.0
            while size > 2.0:  # the same number of cells from 2 to 4 and from 4 to 8 as from 1 to 2
                size, steps = 0.5 * size, steps + 1.0
            at = math.copysign(size + steps, positions[i, axis]) * _CELLS + shift
            cell = np.floor(at)
            key = key << 21 | (int(cell) & 0x1FFFFF)
            near |= not _EDGE <= at - cell <= 1.0 - _EDGE
        keys[i], beside[i] = key, near


def sum_groups(group: Int64s, values: Float64s) -> Float64s:
    """Sums (k, 3) of the `values` (n, 3) of each group."""
    return np.stack([np.bincount(group, values[:, axis]) for axis in range(3)], axis=1)


def _near(positions: Float32s, faces: Int64s, rows: Int64s) -> Int64s:
    """Pairs (j, 2) of `rows` (k,), which are sorted by x, that share a place: indices into these."""
    subset, links = positions[rows], [np.zeros((0, 2), np.int64)]
    for which, keys in grids(subset):
        sort = np.argsort(keys, kind="stable")
        order = which[sort]
        at = subset[order].astype(np.float64)
        radius = contact_radius(at)
        for a, b in _pairs(keys[sort], at[:, 0]):
            near = np.linalg.norm(at[a] - at[b], axis=1) <= radius[a]
            links.append(np.stack([order[a[near]], order[b[near]]], axis=1))
    pairs = np.concatenate(links)
    if not len(pairs):
        return pairs
    longest = np.zeros(len(positions))
    for corner in range(3):
        edge = positions[faces[:, corner]] - positions[faces[:, corner - 1]]
        for end in (corner, corner - 1):
            np.maximum.at(longest, faces[:, end], np.linalg.norm(edge, axis=1))
    large = longest[rows] >= _FINE * contact_radius(subset.astype(np.float64))
    return pairs[large[pairs].all(axis=1)]


def _pairs(keys: AnyInts, along: Float64s | None = None) -> Iterator[tuple[Int64s, Int64s]]:
    """Pairs a < b of equal `keys` (k,), ascending, up to 64 apart; not of what is apart in `along`, ascending too."""
    for step in range(1, min(_NEIGHBOURS, len(keys) - 1) + 1):
        same = keys[step:] == keys[:-step]
        if along is not None:
            same &= along[step:] - along[:-step] <= _EDGE / _CELLS * np.maximum(1.0, np.abs(along[step:]))
        first = np.flatnonzero(same)
        if not len(first):
            return
        yield first, first + step


def _repeated(keys: Int64s) -> Int64s:
    """Rows, ascending, of all `keys` (n,) that occur more than once."""
    ordered = np.sort(keys)
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    if not len(twice):
        return np.zeros(0, np.int64)
    return np.flatnonzero(twice[np.minimum(np.searchsorted(twice, keys), len(twice) - 1)] == keys)
