"""Faces that rays start from, with bounds of the rounding errors beside each of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel.arrays import borrow
from ..kernel.jit import bound, inline, kernel
from ..kernel.vector import cross, length, load_triangle, subtract
from ..mesh.placement import NEAR, TOUCHING, ULP
from ..system.threads import run_blocks, run_ranges, thread_count
from ..types import Float64s, Int64s

FLAT = 1.0 / 16.0
_BLOCK, _MOST = 1 << 11, 32  # faces, and blocks at once
_POINTS = 1 << 12  # of a thread that looks at all faces


class Surface(NamedTuple):
    """Faces in render space; an argument of kernels.

    Attributes:
        vertices: float64 (n, 3). faces: int64 (m, 3), none degenerate. normals: float64 (m, 3), unit.
        extent: float64 (m,), the largest |coordinate| of each face's corners; above `NEAR` no more than counts across.
        flat: float64 (m,), as large as that may be beside a flat triangle: Embree takes the distance of its plane from
            a normal that it computes in float32, whose relative error is that of a coordinate over the sine of the
            largest angle, times the distance of a corner. At most `NEAR`, or as far away as the face is: the offset
            there is 10⁻⁵ of the mesh, no more.
        rounding: float64 (m,), how far from a face a point may be that touches it.
    """

    vertices: Float64s
    faces: Int64s
    normals: Float64s
    extent: Float64s
    flat: Float64s
    rounding: Float64s

    @classmethod
    def of(cls, vertices: Float64s, faces: Int64s, normals: Float64s) -> Surface:
        """These faces, measured; arguments as the attributes."""
        surface = cls(vertices, faces, normals, *(np.zeros(len(faces)) for _ in range(3)))
        run_blocks(len(faces), _BLOCK, bound(_measure, surface), thread_count(None), most=_MOST)
        return surface

    def reversed(self) -> Surface:
        """The same faces, seen from behind."""
        return self._replace(normals=-self.normals)

    def shortest_edges(self, face_points: Int64s, points: Int64s) -> Float64s:
        """The shortest edge (k,) at each of some `points` (k,), numbers in `face_points` (m, 3); ∞ at none."""
        shortest = np.full(int(max(face_points.max(), points.max())) + 1, -1.0)
        shortest[points] = np.inf
        rows, corners = np.nonzero(shortest[face_points] > 0)
        here = self.vertices[self.faces[rows, corners]]
        for step in (1, 2):
            edge = np.linalg.norm(self.vertices[self.faces[rows, (corners + step) % 3]] - here, axis=1)
            np.minimum.at(shortest, face_points[rows, corners], edge)
        return shortest[points]

    def magnitudes(self, face_points: Int64s, count: int) -> Float64s:
        """The scale of the offset at each of `count` points (`ray_offset`), those of `face_points` (m, 3)."""
        around, magnitude, threads = np.zeros(count), np.zeros(count), thread_count(None)
        run_ranges(count, _POINTS, bound(_spread_flat, self.flat, face_points, around), threads)
        run_ranges(count, _POINTS, bound(_magnitudes, self.extent, face_points, around, magnitude), threads)
        return magnitude


@kernel
def _measure(surface, first, last):
    """Fill in `extent`, `flat` and `rounding` of some faces."""
    surface = borrow(surface)
    for f in range(first, last):
        a, b, c = load_triangle(surface.vertices, surface.faces, f)
        across = 0.0
        for axis in range(3):
            largest = max(abs(a[axis]), abs(b[axis]), abs(c[axis]))
            surface.extent[f] = max(surface.extent[f], largest)
            across += abs(surface.normals[f, axis]) * largest
        surface.extent[f], surface.rounding[f] = min(surface.extent[f], max(NEAR, across)), TOUCHING * ULP * across
        ab, bc, ca = subtract(b, a), subtract(c, b), subtract(a, c)
        slender = length(ab) * length(bc) * length(ca) / max(length(cross(ab, bc)), 1e-150)  # longest edge/sine
        surface.flat[f] = min(FLAT * slender, max(NEAR, min(_largest(a), _largest(b), _largest(c))))


@inline
def _largest(p):
    return max(abs(p[0]), abs(p[1]), abs(p[2]))


@kernel
def _spread_flat(flat, face_points, around, first, last):
    """The largest `flat` of the faces of each point."""
    for f in range(len(face_points)):
        for corner in range(3):
            point = face_points[f, corner]
            if first <= point < last and flat[f] > around[point]:  # seldom; a store each time would be waited for
                around[point] = flat[f]


@kernel
def _magnitudes(extent, face_points, around, magnitude, first, last):
    """The largest `extent` of a point's faces, and `flat` of these and of its neighbours' faces, which rays pass by."""
    for f in range(len(face_points)):
        a, b, c = face_points[f, 0], face_points[f, 1], face_points[f, 2]
        if first <= a < last or first <= b < last or first <= c < last:
            largest = max(extent[f], max(around[a], around[b], around[c]))
            for point in (a, b, c):
                if first <= point < last and largest > magnitude[point]:
                    magnitude[point] = largest
