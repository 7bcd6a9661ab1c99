"""Welding: vertices that a file stores apart, but that are one point of one surface, grouped; connected components.

Components by union-find with path halving (Tarjan & van Leeuwen 1984), not scipy.sparse.csgraph, which takes five times
as long for the faces of a mesh, most of it to make a graph of them.
"""

import math
import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ..kernel.arrays import counting_sort
from ..kernel.jit import inline, kernel
from ..kernel.simd import compare_and_swap
from ..system.parallel import each, parallel
from ..types import (
    AnyInts,
    Bools,
    Float32Rows,
    Float32s,
    Float64Rows,
    Float64s,
    Int32Rows,
    Int32s,
    Int64Rows,
    Int64s,
    UInt32Rows,
    UInt32s,
)
from .placement import contact_radius

CREASE = float(np.cos(np.radians(30.0)))  # coincident vertices whose faces differ by more stay apart: a hard edge
_NEIGHBOURS = 64
_SLOTS = 1 << 13  # of a hash table for each thread, at least
_CELLS = 2.0**15  # of a grid, along a unit of render space
_EDGE = 1.0 / 32.0  # of a cell: more than the largest contact radius
_FINE = 16.0  # contact radii; vertices all whose edges are shorter are welded only where they are equal


def connected_components(links: Int32s | Int64s, count: int) -> Int64s:
    """The component (count,) of each member, which the rows of `links` connect; numbered in order of first members."""
    parent = np.arange(count)
    join(links, parent)
    renumber_components(parent)
    return parent


@inline
def _root(parent, i):
    """The root of a member in the forest `parent`, whose paths are halved on the way (union–find)."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@inline
def connect(parent, a, b):
    """Connect two members in the forest `parent` (count,), int64; roots are least, in whichever order they connect.

    On several threads at once: a root that another has connected meanwhile is looked for again.
    """
    while True:
        a = _root(parent, a)
        b = _root(parent, b)
        if a == b or compare_and_swap(parent, max(a, b), max(a, b), min(a, b)):
            break


@each("links")
def join(row: int, links: Int32Rows | Int64Rows, parent: Int64s) -> None:
    """Connect the members in each row of links[first:last], (m, any), in the forest `parent`, as `connect` does two."""
    for k in range(1, links.shape[1]):
        connect(parent, links[row, 0], links[row, k])


@kernel
def renumber_components(parent: Int64s) -> None:
    """Write the number of each member's component in place of its parent."""
    count = 0
    for i in range(len(parent)):  # parents come before their children
        if parent[i] == i:
            parent[i] = count
            count += 1
        else:
            parent[i] = parent[parent[i]]


def weld(positions: Float32s, faces: AnyInts, normals: Float64s, agreement: float) -> Int64s:
    """Group (n,) of each vertex: those `coincident` whose normals agree share a group, numbered from 0.

    Args: normals: (n, 3), unit or zero (agrees with none). agreement: the least cosine.
    """
    representative = coincident(positions, faces)
    group = np.arange(len(positions))
    count = int(representative.max(initial=-1)) + 1
    if count < len(positions):
        _join_agreeing(*counting_sort(representative, count), normals, agreement, group)
        renumber_components(group)
    return group


def coincident(positions: Float32s, faces: AnyInts) -> Int64s:
    """The place (n,) of each of the `positions` (n, 3) in render space, numbered from 0 in the order of first rows.

    Positions share a place if they are equal or within their `contact_radius`, or are linked by others that are; but
    for vertices all whose edges are hardly longer than that, which must be equal.
    """
    # Equal positions: the first of them stands for all.
    representative = first_alike(positions + np.float32(0.0))  # −0 becomes 0
    distinct = np.flatnonzero(representative == np.arange(len(representative)))
    # Others that share a cell of a grid with another, and so may be within its contact radius.
    beside = np.zeros(len(distinct), np.bool_)
    for subset, keys in grids(positions[distinct]):
        alike = first_alike(keys[:, None])
        is_repeated = alike != np.arange(len(alike))
        beside[subset[is_repeated]] = beside[subset[alike[is_repeated]]] = True
    distinct = distinct[beside]
    if len(distinct):
        distinct = distinct[np.lexsort(positions[distinct].T[::-1])]
        pairs = distinct[_near(positions, faces, distinct)]
        join.on(1)(pairs, representative)
    renumber_components(representative)
    return representative


def first_alike(values: npt.NDArray[Any]) -> Int64s:
    """The first of the rows of `values` (n, any) that are equal bit by bit to each row, (n,)."""
    representative = np.empty(len(values), np.int64)
    table = np.zeros(2 << len(values).bit_length(), np.uint32)
    key = np.frombuffer(os.urandom(8), np.uint64)[0]  # so that no file is made of positions that collide
    words = np.ascontiguousarray(values).view(np.uint32)
    _find_first(words, key, table, representative)
    return representative


@parallel("table", _SLOTS, alone=True)
def _find_first(
    start: int, stop: int, words: UInt32Rows, key: np.uint64, table: UInt32s, representative: Int64s
) -> None:
    """Fill in the `representative` row (n,) of `words` (n, any) that is equal to each one with a hash in a range.

    Args: table: of zeros, a power of two and more than n; filled with rows, from 1 on, by hash.
    """
    slot_mask = len(table) - 1
    for i in range(len(words)):
        hashed = key
        for k in range(words.shape[1]):
            hashed = (hashed ^ np.uint64(words[i, k])) * np.uint64(0x9E3779B97F4A7C15)
            hashed ^= hashed >> np.uint64(32)
        at = int(np.int64(hashed)) & slot_mask
        if not start <= at < stop:
            continue
        row = np.int64(0)
        while True:
            row = np.int64(table[at]) - 1
            alike = row >= 0
            for k in range(words.shape[1]):
                alike = alike and words[row, k] == words[i, k]
            if alike or row < 0:
                break
            at += 1
            if at == stop:
                at = start
        if row < 0:
            table[at] = i + 1
        representative[i] = i if row < 0 else row


@inline
def cosine(normals, a, b):
    """The cosine of the angle between rows `a` and `b` of the unit `normals` (n, 3)."""
    return normals[a, 0] * normals[b, 0] + normals[a, 2] * normals[b, 2] + normals[a, 1] * normals[b, 1]


@kernel
def _join_agreeing(order: Int64s, starts: Int64s, normals: Float64Rows, agreement: float, group: Int64s) -> None:
    """Connect vertices order[starts[k] : starts[k + 1]], which are at one place, up to 64 apart, if their normals
    agree."""
    for k in range(len(starts) - 1):
        for i in range(starts[k], starts[k + 1]):
            for j in range(i + 1, min(i + 1 + _NEIGHBOURS, starts[k + 1])):
                if cosine(normals, order[i], order[j]) >= agreement:
                    connect(group, order[i], order[j])


def grids(positions: Float32s) -> Iterator[tuple[Int64s, Int64s]]:
    """Four grids of cells, each moved by a quarter: rows of `positions` (n, 3), and a key of each one's cell.

    Two positions within the contact radius share a key in one of them at least: along each axis they are parted by one
    grid at most. A grid has the rows near borders of all grids before it.
    """
    rows = np.arange(len(positions))
    for quarter in range(4):
        subset = positions[rows] if quarter else positions
        keys = np.empty(len(rows), np.int64)
        beside = np.empty(len(rows), np.bool_)
        _locate(subset, quarter / 4 + 0.1, keys, beside)  # no border is at 0, where many coordinates are
        yield rows, keys
        rows = rows[beside]


@each("positions")
def _locate(i: int, positions: Float32Rows, shift: float, keys: Int64s, beside: Bools) -> None:
    """Write the key (n,) of each position's cell, and into `beside` whether it is near a border of that."""
    key, near = 0, False
    for axis in range(3):
        size, steps = np.float64(abs(positions[i, axis])), 0.0
        while size > 2.0:  # the same number of cells from 2 to 4 and from 4 to 8 as from 1 to 2
            size = 0.5 * size
            steps = steps + 1.0
        at = math.copysign(size + steps, positions[i, axis]) * _CELLS + shift
        cell = np.floor(at)
        key = key << 21 | (int(cell) & 0x1FFFFF)
        near |= not _EDGE <= at - cell <= 1.0 - _EDGE
    keys[i], beside[i] = key, near


def sum_groups(group: Int64s, values: Float64s) -> Float64s:
    """Sums (k, 3) of the `values` (n, 3) of each group."""
    return np.stack([np.bincount(group, values[:, axis]) for axis in range(3)], axis=1)


def _near(positions: Float32s, faces: AnyInts, vertices: Int64s) -> Int64s:
    """Pairs (j, 2) of `vertices` (k,), which are sorted by x, that share a place: indices into these."""
    subset = positions[vertices]
    links = [np.zeros((0, 2), np.int64)]
    for rows, keys in grids(subset):
        sort = np.argsort(keys, kind="stable")
        order = rows[sort]
        at = subset[order].astype(np.float64)
        radius = contact_radius(at)
        for a, b in _pairs(keys[sort], at[:, 0]):
            near = np.linalg.norm(at[a] - at[b], axis=1) <= radius[a]
            links.append(np.stack([order[a[near]], order[b[near]]], axis=1))
    pairs = np.concatenate(links)
    if not len(pairs):
        return pairs
    # Small triangles are not welded: each end needs an edge that is long beside the radius.
    longest = np.zeros(len(positions))
    for corner in range(3):
        edge = positions[faces[:, corner]] - positions[faces[:, corner - 1]]
        for end in (corner, corner - 1):
            np.maximum.at(longest, faces[:, end], np.linalg.norm(edge, axis=1))
    large = longest[vertices] >= _FINE * contact_radius(subset.astype(np.float64))
    return pairs[large[pairs].all(axis=1)]


def _pairs(keys: AnyInts, along: Float64s) -> Iterator[tuple[Int64s, Int64s]]:
    """Pairs a < b of rows with equal `keys` (k,), up to 64 apart, and near each other in `along`; both are
    ascending."""
    for step in range(1, min(_NEIGHBOURS, len(keys) - 1) + 1):
        near = along[step:] - along[:-step] <= _EDGE / _CELLS * np.maximum(1.0, np.abs(along[step:]))
        earlier = np.flatnonzero((keys[step:] == keys[:-step]) & near)
        if not len(earlier):
            return
        yield earlier, earlier + step
