"""Which faces pass by a point within a hair's breadth: seams, T-junctions, feet on floors, plates almost in contact.

Points are put into cells, hashed; a face visits the cells along its plane. Cells are as wide as the points are apart on
average, so the work is in proportion to the number of points and faces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .jit import inline, kernel
from .parallel import run_blocks, thread_count
from .vector import add, cross, dot, load, scale, subtract

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
_WIDTH = 2.0  # of a cell, in mean distances between points
_FEW = 12  # cells of a face's bounding box that are all visited
_BLOCK = 1 << 16  # faces
_FINEST = 2.0**-18  # of the extent: cells are numbered within 21 bits


class Contacts(NamedTuple):
    """Pairs of a point and a face near it: `point`, `face` int64 (j,), `distance` float64 (j,), sorted by point."""

    point: Ints
    face: Ints
    distance: Floats

    def only(self, which: npt.NDArray[np.bool_] | slice) -> Contacts:
        """Some of the pairs; `which` is bool (j,) or a slice."""
        return Contacts(self.point[which], self.face[which], self.distance[which])


def find_contacts(
    points: Floats, reach: Floats, margin: Floats, vertices: Floats, faces: Ints, seats: Ints
) -> Contacts:
    """The faces within the larger of `reach` and `margin` of points, those left out that the point is a corner of.

    Args:
        points (k, 3), reach (k,). vertices (n, 3), faces (m, 3), none degenerate, margin (m,).
        seats: (m, 3), the row of `points` that each face corner is.
    """
    if not len(points) or not len(faces):
        return _room(0)
    widest = max(float(reach.max()), float(margin.max()))
    extent = float(np.ptp(points, axis=0).max()) + 2 * widest
    cell = max(_WIDTH * np.sqrt(_area(vertices, faces) / len(points)), 4 * widest, _FINEST * extent)
    low = points.min(axis=0) - widest
    cells = np.floor((points - low) / cell).astype(np.int64)
    size = 1 << (2 * len(points)).bit_length()
    starts, order = np.zeros(size + 1, np.int64), np.empty(len(cells), np.int64)
    _sort(cells, starts, order)
    high = np.ceil((points.max(axis=0) - low) / cell).astype(np.int64)

    grid = low, high, cell, starts, order, cells[order]  # what is sorted by cell is read in the order of memory
    points, reach = points[order], reach[order]
    parts: list[Contacts] = [_room(0)] * -(-len(faces) // _BLOCK)

    def search(first: int, last: int) -> None:
        found = _room(_BLOCK // 16)
        some = points, reach, margin[first:last], widest, vertices, faces[first:last], seats[first:last]
        while (count := _pairs(*some, *grid, *found)) > len(found.point):
            found = _room(count)
        parts[first // _BLOCK] = Contacts(found.point, found.face + first, found.distance).only(slice(count))

    run_blocks(len(faces), _BLOCK, search, thread_count(None))
    point, face, distance = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort((face, point))
    return Contacts(point[order], face[order], distance[order])


def _room(count: int) -> Contacts:
    return Contacts(np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count))


@inline
def _hash(x, y, z, mask):
    mixed = x * 73856093 ^ y * 19349663 ^ z * 83492791  # Teschner et al. 2003
    return (mixed ^ (mixed >> 15)) & mask


@kernel
def _sort(cells, starts, order):
    """Order points by the hash of their cell: bucket b holds order[starts[b] : starts[b + 1]]."""
    mask = len(starts) - 2
    bucket = np.empty(len(cells), np.int64)
    for i in range(len(cells)):
        bucket[i] = _hash(cells[i, 0], cells[i, 1], cells[i, 2], mask)
        starts[bucket[i]] += 1
    for b in range(mask + 1):
        starts[b + 1] += starts[b]
    for i in range(len(cells) - 1, -1, -1):
        starts[bucket[i]] -= 1
        order[starts[bucket[i]]] = i


@kernel
def _area(vertices, faces):
    total = 0.0
    for f in range(len(faces)):
        a, b, c = load(vertices, faces[f, 0]), load(vertices, faces[f, 1]), load(vertices, faces[f, 2])
        normal = cross(subtract(b, a), subtract(c, a))
        total += 0.5 * np.sqrt(dot(normal, normal))
    return total


@inline
def distance_to_triangle(p, a, b, c):
    """Distance of a point from a triangle. Source: Ericson, Real-Time Collision Detection, 5.1.5."""
    ab, ac, ap = subtract(b, a), subtract(c, a), subtract(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    bp, cp = subtract(p, b), subtract(p, c)
    d3, d4, d5, d6 = dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        near = a
    elif d3 >= 0.0 and d4 <= d3:
        near = b
    elif d6 >= 0.0 and d5 <= d6:
        near = c
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        near = add(a, scale(d1 / (d1 - d3), ab))
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        near = add(a, scale(d2 / (d2 - d6), ac))
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        near = add(b, scale((d4 - d3) / ((d4 - d3) + (d5 - d6)), subtract(c, b)))
    else:
        total = va + vb + vc
        near = add(a, add(scale(vb / total, ab), scale(vc / total, ac)))
    away = subtract(p, near)
    return np.sqrt(dot(away, away))


@inline
def _span(corners, u, v, left, right):
    """Range of the coordinate v that a triangle has where its coordinate u lies in [left, right]."""
    low, high = np.inf, -np.inf
    for k in range(3):
        p, q = corners[k], corners[(k + 1) % 3]
        if left <= p[u] <= right:
            low, high = min(low, p[v]), max(high, p[v])
        for side in (left, right):
            if (p[u] < side) != (q[u] < side):
                at = p[v] + (side - p[u]) / (q[u] - p[u]) * (q[v] - p[v])
                low, high = min(low, at), max(high, at)
    return low, high


@inline
def _cells(bottom, top, low, cell, high):
    """First and last number of the cells that hold [bottom, top] along one axis, within 0 and `high`."""
    return max(int(np.floor((bottom - low) / cell)), 0), min(int(np.floor((top - low) / cell)), high)


@kernel
def _pairs(
    points, reach, margin, widest, vertices, faces, seats, low, high, cell, starts, order, cells, point, face, distance
):
    """Write the pairs into point, face, distance as far as they fit, and return how many there are.

    Args: points, reach, cells: in the `order` of their buckets.
    """
    count = 0
    mask = len(starts) - 2
    corners, bottom, top = np.empty((3, 3)), np.empty(3), np.empty(3)
    begin, end, at = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
    for f in range(len(faces)):
        size = 1
        for axis in range(3):
            for k in range(3):
                corners[k, axis] = vertices[faces[f, k], axis]
            bottom[axis] = min(corners[0, axis], corners[1, axis], corners[2, axis]) - widest
            top[axis] = max(corners[0, axis], corners[1, axis], corners[2, axis]) + widest
            begin[axis], end[axis] = _cells(bottom[axis], top[axis], low[axis], cell, high[axis])
            size *= max(end[axis] - begin[axis] + 1, 0)
        a, b, c = load(corners, 0), load(corners, 1), load(corners, 2)
        normal = cross(subtract(b, a), subtract(c, a))
        length = np.sqrt(dot(normal, normal)) * (1.0 + 1e-9)
        w = 0
        if abs(normal[1]) > abs(normal[w]):
            w = 1
        if abs(normal[2]) > abs(normal[w]):
            w = 2
        u, v = (w + 1) % 3, (w + 2) % 3
        slope_u, slope_v = -normal[u] / normal[w], -normal[v] / normal[w]
        slack = widest + 0.5 * cell * (abs(slope_u) + abs(slope_v))
        for i in range(begin[u], end[u] + 1):
            first_j, last_j = begin[v], end[v]
            left = low[u] + i * cell
            if size > _FEW:
                first, last = _span(corners, u, v, left - widest, left + cell + widest)
                if first > last:
                    continue
                first_j, last_j = _cells(first - widest, last + widest, low[v], cell, high[v])
            for j in range(first_j, last_j + 1):
                first_k, last_k = begin[w], end[w]
                if size > _FEW:
                    middle_u, middle_v = left + 0.5 * cell - corners[0, u], low[v] + (j + 0.5) * cell - corners[0, v]
                    level = corners[0, w] + slope_u * middle_u + slope_v * middle_v
                    deepest, highest = max(level - slack, bottom[w]), min(level + slack, top[w])
                    first_k, last_k = _cells(deepest, highest, low[w], cell, high[w])
                for k in range(first_k, last_k + 1):
                    at[u], at[v], at[w] = i, j, k
                    bucket = _hash(at[0], at[1], at[2], mask)
                    for place in range(starts[bucket], starts[bucket + 1]):
                        p = points[place, 0], points[place, 1], points[place, 2]
                        if (
                            p[0] < bottom[0] or p[0] > top[0]
                            or p[1] < bottom[1] or p[1] > top[1]
                            or p[2] < bottom[2] or p[2] > top[2]
                        ):  # fmt: skip
                            continue
                        row = order[place]
                        if seats[f, 0] == row or seats[f, 1] == row or seats[f, 2] == row:
                            continue
                        if cells[place, 0] != at[0] or cells[place, 1] != at[1] or cells[place, 2] != at[2]:
                            continue
                        near = max(reach[place], margin[f])
                        if abs(dot(normal, subtract(p, a))) > near * length:
                            continue
                        away = distance_to_triangle(p, a, b, c)
                        if away <= near:
                            if count < len(point):
                                point[count], face[count], distance[count] = row, f, away
                            count += 1
    return count
