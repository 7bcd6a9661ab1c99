"""Which faces pass by a point within a hair's breadth: seams, T-junctions, feet on floors, plates almost in contact.

Points are put into cells, hashed; a face visits the cells along its plane. Cells are as wide as the points are apart on
average, so the work is in proportion to the number of points and faces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .jit import inline, kernel
from .vector import add, cross, dot, load, scale, subtract

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
_FINEST = 2.0**-18  # of the extent: cells are numbered within 21 bits


class Contacts(NamedTuple):
    """Pairs of a point and a face near it: `point`, `face` int64 (j,), `distance` float64 (j,), sorted by point."""

    point: Ints
    face: Ints
    distance: Floats


def find_contacts(points: Floats, reach: Floats, vertices: Floats, faces: Ints, seats: Ints) -> Contacts:
    """The faces within `reach` of points, those left out that the point is a corner of.

    Args:
        points (k, 3), reach (k,). vertices (n, 3), faces (m, 3), none degenerate.
        seats: (m, 3), the row of `points` that each face corner is.
    """
    none = Contacts(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
    if not len(points) or not len(faces):
        return none
    edges = vertices[faces[:, 1:]] - vertices[faces[:, :1]]
    area = 0.5 * float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())
    widest = float(reach.max())
    extent = float(np.ptp(points, axis=0).max()) + 2 * widest
    cell = max(np.sqrt(area / len(points)), 4 * widest, _FINEST * extent)
    low = points.min(axis=0) - widest
    cells = np.floor((points - low) / cell).astype(np.int64)
    size = 1 << (2 * len(points)).bit_length()
    bucket = _buckets(cells, size - 1)
    order = np.argsort(bucket, kind="stable")
    starts = np.searchsorted(bucket[order], np.arange(size + 1))
    high = np.ceil((points.max(axis=0) - low) / cell).astype(np.int64)

    found = none
    while True:
        count = _pairs(points, reach, widest, vertices, faces, seats, low, high, cell, starts, order, cells, *found)
        if count <= len(found.point):
            break
        found = Contacts(np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count))
    order = np.lexsort((found.face, found.point))
    return Contacts(found.point[order], found.face[order], found.distance[order])


@inline
def _hash(x, y, z, mask):
    mixed = x * 73856093 ^ y * 19349663 ^ z * 83492791  # Teschner et al. 2003
    return (mixed ^ (mixed >> 15)) & mask


@kernel
def _buckets(cells, mask):
    out = np.empty(len(cells), np.int64)
    for i in range(len(cells)):
        out[i] = _hash(cells[i, 0], cells[i, 1], cells[i, 2], mask)
    return out


@inline
def distance_to_triangle(p, a, b, c):
    """Distance of a point from the nearest point of a triangle. Source: Ericson, Real-Time Collision Detection, 5.1.5."""
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


@kernel
def _pairs(points, reach, widest, vertices, faces, seats, low, high, cell, starts, order, cells, point, face, distance):
    """Write the pairs into point, face, distance as far as they fit, and return how many there are."""
    count = 0
    mask = len(starts) - 2
    corners = np.empty((3, 3))
    at = np.empty(3, np.int64)
    for f in range(len(faces)):
        for k in range(3):
            for axis in range(3):
                corners[k, axis] = vertices[faces[f, k], axis]
        a, b, c = load(corners, 0), load(corners, 1), load(corners, 2)
        normal = cross(subtract(b, a), subtract(c, a))
        w = 0
        if abs(normal[1]) > abs(normal[w]):
            w = 1
        if abs(normal[2]) > abs(normal[w]):
            w = 2
        u, v = (w + 1) % 3, (w + 2) % 3
        slope_u, slope_v = -normal[u] / normal[w], -normal[v] / normal[w]
        slack = widest + 0.5 * cell * (abs(slope_u) + abs(slope_v))
        bottom, top = corners[:, u].min() - widest, corners[:, u].max() + widest
        low_w, high_w = corners[:, w].min() - widest, corners[:, w].max() + widest
        for i in range(max(int(np.floor((bottom - low[u]) / cell)), 0),
                       min(int(np.floor((top - low[u]) / cell)), high[u]) + 1):
            left = low[u] + i * cell
            first, last = _span(corners, u, v, left - widest, left + cell + widest)
            if first > last:
                continue
            for j in range(max(int(np.floor((first - widest - low[v]) / cell)), 0),
                           min(int(np.floor((last + widest - low[v]) / cell)), high[v]) + 1):
                middle_u, middle_v = left + 0.5 * cell - corners[0, u], low[v] + (j + 0.5) * cell - corners[0, v]
                level = corners[0, w] + slope_u * middle_u + slope_v * middle_v
                deepest, highest = max(level - slack, low_w), min(level + slack, high_w)
                for k in range(max(int(np.floor((deepest - low[w]) / cell)), 0),
                               min(int(np.floor((highest - low[w]) / cell)), high[w]) + 1):
                    at[u], at[v], at[w] = i, j, k
                    bucket = _hash(at[0], at[1], at[2], mask)
                    for place in range(starts[bucket], starts[bucket + 1]):
                        row = order[place]
                        if cells[row, 0] != at[0] or cells[row, 1] != at[1] or cells[row, 2] != at[2]:
                            continue
                        if seats[f, 0] == row or seats[f, 1] == row or seats[f, 2] == row:
                            continue
                        away = distance_to_triangle(load(points, row), a, b, c)
                        if away <= reach[row]:
                            if count < len(point):
                                point[count], face[count], distance[count] = row, f, away
                            count += 1
    return count
