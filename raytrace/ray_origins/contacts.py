"""Which faces pass by a point within a hair's breadth: seams, T-junctions, feet on floors, plates almost in contact."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..embree.point_query import HEAD, NOTE, faces_near
from ..embree.scene import TriangleScene
from ..kernel.arrays import aligned
from ..kernel.jit import inline, kernel
from ..kernel.vector import add, dot, load, scale, subtract
from ..mesh.placement import ULP
from ..system.threads import run_blocks, thread_count

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
_BLOCK = 1 << 12  # points
_MOST = 64  # contacts of one point; of more, those with the lowest rows are kept
_FEW = 64  # faces that the boxes of Embree's hierarchy put near a point: room for these at first


class Contacts(NamedTuple):
    """Pairs of a point and a face near it, sorted: `point`, `face` int64 (j,), `distance` float64 (j,)."""

    point: Ints
    face: Ints
    distance: Floats

    def only(self, which: npt.NDArray[np.bool_] | slice) -> Contacts:
        """Some of the pairs; `which` is bool (j,) or a slice."""
        return Contacts(self.point[which], self.face[which], self.distance[which])


def find_contacts(
    scene: TriangleScene, points: Floats, reach: Floats, margin: Floats, vertices: Floats, faces: Ints, seats: Ints
) -> Contacts:
    """The faces within the larger of `reach` and `margin` of points, those left out that the point is a corner of.

    Args:
        scene: holds exactly the `faces`. points (k, 3). reach (k,), negative for points that are left out.
        vertices (n, 3), faces (m, 3), none degenerate, margin (m,).
        seats: (m, 3), the row of `points` that each face corner is.
    """
    if not len(points) or not len(faces):
        return _room(0)
    widest = float(margin.max())
    slack = 8.0 * ULP * max(float(np.abs(points).max()), float(np.abs(vertices).max()))  # Embree's own rounding
    parts: list[Contacts] = [_room(0)] * -(-len(points) // _BLOCK)

    def search(first: int, last: int) -> None:
        found, near = _room(_BLOCK // 16), np.empty(HEAD + _FEW, np.int64)
        query, context = aligned((8,), np.float32), aligned((64,), np.uint32)
        some = query, context, first, points[first:last], reach[first:last], margin, widest, slack
        while True:
            count, most = _pairs(scene.handle, NOTE, near, *some, vertices, faces, seats, *found)
            if count <= len(found.point) and HEAD + most <= len(near):
                break
            found, near = _room(count), np.empty(HEAD + most, np.int64)
        parts[first // _BLOCK] = found.only(slice(count))

    run_blocks(len(points), _BLOCK, search, thread_count(None))
    point, face, distance = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Contacts(point, face, distance)


def _room(count: int) -> Contacts:
    return Contacts(np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count))


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
def _beside(p, reach, a, b, c):
    """Whether the interval from the least to the largest of a, b and c is farther from `p` than `reach`."""
    return min(a, b, c) - reach > p or max(a, b, c) + reach < p


@kernel
def _pairs(
    scene, note, near, query, context, first, points, reach, margin, widest, slack, vertices, faces, seats,
    point, face, distance,
):  # fmt: skip
    """Write the pairs into point, face, distance as far as they fit.

    Returns how many there are, and how many faces at most were near one point, of which only those in `near` count.
    """
    count, most = 0, 0
    kept, distances = np.empty(_MOST, np.int64), np.empty(_MOST)
    for i in range(len(points)):
        if reach[i] < 0.0:
            continue
        p = load(points, i)
        several = faces_near(scene, note, p, max(reach[i], widest) + slack, query, context, near)
        most = max(most, several)
        last = 0
        for k in range(HEAD, min(HEAD + several, len(near))):
            f = near[k]
            row = first + i
            if seats[f, 0] == row or seats[f, 1] == row or seats[f, 2] == row:
                continue
            within = max(reach[i], margin[f])
            a, b, c = load(vertices, faces[f, 0]), load(vertices, faces[f, 1]), load(vertices, faces[f, 2])
            if _beside(p[0], within, a[0], b[0], c[0]) or _beside(p[1], within, a[1], b[1], c[1]):
                continue
            if _beside(p[2], within, a[2], b[2], c[2]):
                continue
            away = distance_to_triangle(p, a, b, c)
            if away <= within:
                if last == _MOST and f > kept[last - 1]:
                    continue
                place = min(last, _MOST - 1)
                while place > 0 and kept[place - 1] > f:
                    kept[place], distances[place] = kept[place - 1], distances[place - 1]
                    place -= 1
                kept[place], distances[place] = f, away
                last = min(last + 1, _MOST)
        for k in range(last):
            if count < len(point):
                point[count], face[count], distance[count] = first + i, kept[k], distances[k]
            count += 1
    return count, most
