"""Faces that points touch or almost touch: seams, T-junctions, feet on floors, plates almost in contact."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..bvh.bvh16 import BVH16
from ..bvh.closest import begin, closest_on_triangle, new_stack, next_leaf
from ..kernel.arrays import borrow
from ..kernel.jit import bound, inline, kernel
from ..kernel.simd import lowest_bit
from ..kernel.vector import load, load_triangle
from ..mesh.placement import NEAR, TOUCHING, ULP
from ..system.threads import run_blocks, thread_count
from ..types import Bools, Float64s, Int64s
from .surface import Surface

_BLOCK = 1 << 10  # points
_USUAL = 4  # contacts of a point that there are places for at first; coarse boxes on end have 2.5
_MOST = 64  # contacts of one point; of more, those with the lowest rows are kept
_SEEN = 1 << 10  # faces that are compared with these; then no more are looked for
_USUAL_ROUNDING = 3.0 * NEAR * TOUCHING * ULP  # of all faces but those that reach far away
_CLASS = 16.0  # ratio of the roundings of faces that are searched for together


class Contacts(NamedTuple):
    """Pairs of a point and a face near it, sorted: `point`, `face` int64 (j,), `distance` float64 (j,)."""

    point: Int64s
    face: Int64s
    distance: Float64s

    def only(self, which: Bools | Int64s) -> Contacts:
        """Some of the pairs, copied; `which` is bool (j,) or their rows."""
        return Contacts(self.point[which], self.face[which], self.distance[which])


_Points = tuple[Float64s, Float64s, Int64s, Int64s]  # points, reach, face_points, numbers


def find_contacts(
    tree: BVH16, surface: Surface, points: Float64s, reach: Float64s, face_points: Int64s, numbers: Int64s
) -> Contacts:
    """The faces within the larger of `reach` and their `rounding` of points, but not those that a point is a corner of.

    Args: tree: over the faces of `surface`. points: (k, 3), render space. reach: (k,), negative to leave points out.
        face_points: int64 (m, 3), the number of the point that each face corner is. numbers: int64 (k,), of each point.
    """
    if not (reach >= 0.0).any() or not len(surface.faces):
        return _empty(0)
    around, most = (points, reach, face_points, numbers), float(surface.rounding.max())
    if most <= _USUAL_ROUNDING:
        return _find(tree, surface, around, most)
    found, least = [], -1.0
    while least < most:
        limit = max(_CLASS * least, _USUAL_ROUNDING)
        rows = np.flatnonzero((surface.rounding > least) & (surface.rounding <= limit))
        if len(rows):
            some = BVH16.of(surface.vertices.astype(np.float32), surface.faces[rows])
            some = some._replace(rows=np.where(some.rows < 0, -1, rows[some.rows]))
            found.append(_find(some, surface, around, limit))
        least = limit
    joined = Contacts(*(np.concatenate(column) for column in zip(*found, strict=True)))
    joined = joined.only(np.lexsort((joined.face, joined.point)))
    place = np.arange(len(joined.point)) - np.searchsorted(joined.point, joined.point)
    return joined.only(place < _MOST)


def _find(tree: BVH16, surface: Surface, around: _Points, most: float) -> Contacts:
    """`find_contacts` of the faces of a tree, whose rounding is `most` at most."""
    count = len(around[0])
    parts: list[Contacts] = [_empty(0)] * -(-count // _BLOCK)

    def search(first: int, last: int) -> None:
        found, fill = _empty(_USUAL * _BLOCK), bound(_search, tree, new_stack(), surface, around, most)
        size = fill(first, last, found)
        if size > len(found.point):
            found = _empty(size)
            fill(first, last, found)
        parts[first // _BLOCK] = found.only(np.arange(size))  # copies, so that the rest is let go

    run_blocks(count, _BLOCK, search, thread_count(None))
    point, face, distance = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Contacts(point, face, distance)


def _empty(count: int) -> Contacts:
    return Contacts(np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count))


@inline
def _beside(p, reach, a, b, c):
    """Whether the interval from the least to the largest of a, b and c is farther from `p` than `reach`."""
    return min(a, b, c) - reach > p or max(a, b, c) + reach < p


@kernel
def _search(tree, stack, surface, around, most, first, last, found):
    """Write the contacts of points from `first` to `last` into `found` as far as they fit; returns their number."""
    tree, surface, found = borrow(tree), borrow(surface), borrow(found)
    (points, reach, corners, numbers), count = borrow(around), 0
    nearest = kept, distances = np.empty(_MOST, np.int64), np.empty(_MOST)
    for i in range(first, last):
        if reach[i] < 0.0:
            continue
        p, number, filled, seen = load(points, i), numbers[i], 0, 0
        place = begin(tree, stack, p, max(reach[i], most))
        leaf, near = next_leaf(tree, stack, place)
        while near != 0 and seen < _SEEN:
            while near != 0:
                f = tree.rows[leaf, lowest_bit(near)]
                near &= near - 1
                seen += filled == _MOST
                if corners[f, 0] != number and corners[f, 1] != number and corners[f, 2] != number:
                    filled = _keep(surface, f, p, max(reach[i], surface.rounding[f]), nearest, filled)
            leaf, near = next_leaf(tree, stack, place)
        for k in range(filled):
            if count < len(found.point):
                found.point[count], found.face[count], found.distance[count] = i, kept[k], distances[k]
            count += 1
    return count


@inline
def _keep(surface, f, p, within, nearest, filled):
    """Add a face to those `filled`, sorted by number, and their distances if it is near enough; how many there are."""
    kept, distances = nearest
    a, b, c = load_triangle(surface.vertices, surface.faces, f)
    if _beside(p[0], within, a[0], b[0], c[0]) or _beside(p[1], within, a[1], b[1], c[1]):
        return filled
    if _beside(p[2], within, a[2], b[2], c[2]):
        return filled
    away = closest_on_triangle(p, a, b, c)[0]
    if away > within or (filled == _MOST and f > kept[filled - 1]):
        return filled
    place = min(filled, _MOST - 1)
    while place > 0 and kept[place - 1] > f:
        kept[place], distances[place] = kept[place - 1], distances[place - 1]
        place -= 1
    kept[place], distances[place] = f, away
    return min(filled + 1, _MOST)
