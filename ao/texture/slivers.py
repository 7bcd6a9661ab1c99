"""Texels of which charts cover so little that no ray meets them: points in what each has in common with a face."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from raytrace.embree.point_query import HEAD, PointQuery, faces_near
from raytrace.embree.scene import TriangleScene
from raytrace.kernel.borrow import borrow
from raytrace.kernel.jit import inline, kernel
from raytrace.system.threads import run_blocks
from raytrace.types import Float32s, Float64s, Int64s

_BLOCK = 1 << 14  # texels
_FEW = 64  # faces near a texel that there are places for at first
_LEAST = 1e-9  # area, in texels, that is any at all
_CORNERS = 8  # of a triangle cut by a square, at most 7


class Slivers(NamedTuple):
    """Faces that reach into some texels: `face` int64 (k,), −1 for none; `barycentric` float32 (k, 3)."""

    face: Int64s
    barycentric: Float32s


def find_slivers(
    scene: TriangleScene, corners: Float64s, middle: float, texels: Int64s, width: int, threads: int
) -> Slivers:
    """The face that covers most of each of the `texels`, and the centroid of what it covers.

    Args:
        scene: holds the triangles `corners` (t, 3, 2), texels, at heights within `middle` of `middle`.
        texels: int64 (k,), row · width + column.
    """
    found = Slivers(np.full(len(texels), -1), np.zeros((len(texels), 3), np.float32))
    radius = np.sqrt(0.5 + middle**2) * (1 + 1e-5)

    def work(first: int, last: int) -> None:
        some, capacity = Slivers(found.face[first:last], found.barycentric[first:last]), _FEW
        while True:
            query = PointQuery.of(scene, capacity)
            largest = _search(query, corners, texels[first:last], width, middle, radius, some)
            if largest <= capacity:
                return
            capacity = largest

    run_blocks(len(texels), _BLOCK, work, threads)
    return found


@kernel
def _search(query, corners, texels, width, middle, radius, found):
    """Write `found` of some texels; returns how many faces at most were near one, of which only those noted count."""
    query, corners, texels, found = borrow(query), borrow(corners), borrow(texels), borrow(found)
    one, other, weights = np.empty((_CORNERS, 2)), np.empty((_CORNERS, 2)), np.empty(3)
    largest = 0
    for i in range(len(texels)):
        left, top = np.float64(texels[i] % width), np.float64(texels[i] // width)
        several = faces_near(query, (left + 0.5, top + 0.5, middle), radius)
        largest = max(largest, several)
        best, best_face = _LEAST, -1
        for k in range(HEAD, min(HEAD + several, len(query.near))):
            f = query.near[k]
            area, x, y = _common(corners[f], left, top, one, other)
            if area > best or (area == best and f < best_face):
                best, best_face = area, f
                _weights(corners[f], x, y, weights)
                for corner in range(3):
                    found.barycentric[i, corner] = weights[corner]
        found.face[i] = best_face
    return largest


@inline
def _common(triangle, left, top, polygon, scratch):
    """Area and centroid of what a triangle and a texel have in common (Sutherland & Hodgman 1974)."""
    for k in range(3):
        polygon[k, 0], polygon[k, 1] = triangle[k, 0] - left, triangle[k, 1] - top
    count = 3
    for side in range(4):
        axis, low = side % 2, side < 2
        kept = 0
        for k in range(count):
            ahead = (k + 1) % count
            here = polygon[k, axis] if low else 1.0 - polygon[k, axis]
            there = polygon[ahead, axis] if low else 1.0 - polygon[ahead, axis]
            if here >= 0.0:
                scratch[kept, 0], scratch[kept, 1] = polygon[k, 0], polygon[k, 1]
                kept += 1
            if (here < 0.0) != (there < 0.0):
                part = here / (here - there)
                for c in range(2):
                    scratch[kept, c] = polygon[k, c] + part * (polygon[ahead, c] - polygon[k, c])
                kept += 1
        count = kept
        for k in range(count):
            polygon[k, 0], polygon[k, 1] = scratch[k, 0], scratch[k, 1]
    double = x = y = 0.0
    for k in range(1, count - 1):
        ax, ay = polygon[k, 0] - polygon[0, 0], polygon[k, 1] - polygon[0, 1]
        bx, by = polygon[k + 1, 0] - polygon[0, 0], polygon[k + 1, 1] - polygon[0, 1]
        part = ax * by - ay * bx
        double += part
        x += part * (ax + bx) / 3.0
        y += part * (ay + by) / 3.0
    if count < 3 or double == 0.0:
        return 0.0, left, top
    return abs(double) / 2.0, left + polygon[0, 0] + x / double, top + polygon[0, 1] + y / double


@inline
def _weights(triangle, x, y, out):
    """Barycentric coordinates of a point, none below 0."""
    for k in range(3):
        b, c = (k + 1) % 3, (k + 2) % 3
        bx, by = triangle[b, 0] - x, triangle[b, 1] - y
        cx, cy = triangle[c, 0] - x, triangle[c, 1] - y
        out[k] = bx * cy - by * cx
    total = out[0] + out[1] + out[2]
    for k in range(3):
        out[k] = max(out[k] / total, 0.0)
    total = out[0] + out[1] + out[2]
    for k in range(3):
        out[k] /= total
