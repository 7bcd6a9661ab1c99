"""Points on faces: where they are, the hemispheres above them, and whether one of them can stand for a texel."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from raytrace.bvh.bvh16 import BVH16
from raytrace.bvh.closest import begin, closest_on_triangle, new_stack, next_leaf
from raytrace.kernel.arrays import unrefcounted_view
from raytrace.kernel.jit import bind, inline, kernel
from raytrace.kernel.simd import lowest_bit
from raytrace.kernel.vector import dot, length, load, load_triangle, scale, store, subtract
from raytrace.mesh.normals import face_normals
from raytrace.ray_origins.surface import Surface
from raytrace.system.threads import run_blocks
from raytrace.types import Bools, Float32s, Float64s, Int64s

from ..points.receivers import Receivers
from .coverage import Coverage

_LEAST_COSINE = 0.2  # between an interpolated normal and its face's, which is used below that
_AROUND = 7.0  # times the way from a texel's centre to its points, in which nothing may rise
_SLOPE = 2.0  # by more than so many times what normals may differ by, of its distance
_OWN, _LEVEL = 0.25, 1e-3  # of that way: how far the texel reaches, and what is flat but for rounding
_BLOCK, _SHARE = 1 << 10, 16  # points, and blocks at once


@dataclass(frozen=True, eq=False)
class Faces:
    """Faces in render space. Attributes: axes: (n, 3), of the vertices, unit or zero."""

    axes: Float64s
    surface: Surface

    @classmethod
    def of(cls, vertices: Float64s, receivers: Receivers) -> Self:
        """The faces of `receivers` over `vertices` (n, 3)."""
        axes = np.concatenate([receivers.points.normals, np.zeros((1, 3), np.float32)])[receivers.of_vertex]
        normals = face_normals(vertices, receivers.faces)[0]
        return cls(axes.astype(np.float64), Surface.of(vertices, receivers.faces, normals))

    def points_at(self, own: Int64s, weights: Float32s, threads: int) -> tuple[Float64s, Float64s, Float64s]:
        """Points (k, 3) at `weights` on faces `own`: places, normals on the hemispheres' side, and their axes."""
        places, sides, axes = np.empty((3, len(own), 3))
        work = bind(_place, own, weights, self.surface, self.axes, (places, sides, axes))
        run_blocks(len(own), _BLOCK, work, threads, most=_SHARE)
        return places, sides, axes


def centres_suffice(coverage: Coverage, faces: Faces, tree: BVH16, most: float, threads: int) -> Bools:
    """Whether the point at the centre can stand for all of a texel, (k,), as it does for linear functions.

    The surface is smooth there, normals differ by less than `most`, and nothing rises from it nearby.
    """
    enough = np.zeros(len(coverage.texels), np.bool_)
    points = coverage.face, coverage.barycentric, coverage.centre_face, coverage.centre

    def work(first: int, last: int) -> None:
        subset = tuple(array[first:last] for array in points)
        _find_smooth(tree, new_stack(), faces.surface, faces.axes, subset, most, enough[first:last])

    run_blocks(len(enough), _BLOCK, work, threads, most=_SHARE)
    return enough


@inline
def _point_on(surface, axes, f, weights):
    """A point on a face, the normal of that on the side of the point's hemisphere, and the axis of this."""
    x = y = z = nx = ny = nz = 0.0
    for corner in range(3):
        weight, vertex = np.float64(weights[corner]), surface.faces[f, corner]
        p, n = load(surface.vertices, vertex), load(axes, vertex)
        x, y, z = x + weight * p[0], y + weight * p[1], z + weight * p[2]
        nx, ny, nz = nx + weight * n[0], ny + weight * n[1], nz + weight * n[2]
    side, axis = load(surface.normals, f), (nx, ny, nz)
    size = np.sqrt(dot(axis, axis))
    cosine = dot(axis, side)
    if cosine < 0.0:
        side, cosine = scale(-1.0, side), -cosine
    flat = size < 1e-6 or cosine < _LEAST_COSINE * size or cosine > (1.0 - 1e-12) * size
    return (x, y, z), side, side if flat else scale(1.0 / size, axis)


@kernel
def _place(own, weights, surface, axes, out, first, last):
    surface = unrefcounted_view(surface)
    places, sides, hemispheres = unrefcounted_view(out)
    for i in range(first, last):
        place, side, axis = _point_on(surface, axes, own[i], weights[i])
        store(places, i, place)
        store(sides, i, side)
        store(hemispheres, i, axis)


@kernel
def _find_smooth(tree, stack, surface, axes, points, most, enough):
    tree = unrefcounted_view(tree)
    surface = unrefcounted_view(surface)
    face, weights, centre_face, centre = points
    for i in range(len(enough)):
        if centre_face[i] < 0:
            continue
        p, side, axis = _point_on(surface, axes, centre_face[i], centre[i])
        reach, bent = 0.0, 0.0
        for k in range(face.shape[1]):
            q, other, up = _point_on(surface, axes, face[i, k], weights[i, k])
            reach = max(reach, length(subtract(q, p)))
            bent = max(bent, length(subtract(other, side)), length(subtract(up, axis)))
        enough[i] = bent < most and not _rises(tree, stack, surface, p, side, _AROUND * reach, _SLOPE * most)


@inline
def _rises(tree, stack, surface, p, side, reach, slope):
    """Whether a face not far around a point rises above the plane through it, by more than a slope."""
    around = begin(tree, stack, p, reach)
    leaf, near = next_leaf(tree, stack, around)
    while near != 0:
        while near != 0:
            f = tree.rows[leaf, lowest_bit(near)]
            near &= near - 1
            a, b, c = load_triangle(surface.vertices, surface.faces, f)
            to_a = subtract(a, p)
            height = max(dot(to_a, side), dot(subtract(b, p), side), dot(subtract(c, p), side))
            if height <= _LEVEL * slope * reach:
                continue
            distance, normal = closest_on_triangle(p, a, b, c)[0], load(surface.normals, f)
            if distance > reach:
                continue
            if length(subtract(normal, side)) < slope:
                if abs(dot(to_a, normal)) > slope * max(distance, _LEVEL * reach):
                    return True
            elif height > slope * max(distance - _OWN * reach, 0.0):
                return True
        leaf, near = next_leaf(tree, stack, around)
    return False
