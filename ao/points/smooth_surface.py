"""Points on faces whose normals are interpolated between vertices: positions, normals, axes of hemispheres."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from raytrace.kernel.jit import inline
from raytrace.kernel.vector import add, dot, load, load_triangle, scale, store
from raytrace.mesh.normals import face_normals
from raytrace.ray_origins.surface import Surface
from raytrace.system.parallel import each
from raytrace.types import Float32Rows, Float32s, Float64Rows, Float64s, Int32s, Int64Rows, Int64s

from .receivers import Receivers

_LEAST_COSINE = 0.2  # between an interpolated normal and its face's, which is used below that


class SurfacePoints(NamedTuple):
    """Points on the faces of a mesh."""

    face: Int32s  # (p,)
    barycentric: Float32s  # (p, 3)


class PointGroups(NamedTuple):
    """Points on the faces of a mesh in k groups, those of group i from starts[i] to starts[i + 1]."""

    starts: Int64s  # (k + 1,)
    face: Int32s  # (p,)
    barycentric: Float32Rows  # (p, 3)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The groups of several parts, one after the other."""
        counts = np.concatenate([np.diff(part.starts) for part in parts])
        face = np.concatenate([part.face for part in parts])
        barycentric = np.concatenate([part.barycentric for part in parts])
        return cls(np.concatenate([[0], np.cumsum(counts)]), face, barycentric)


class SmoothSurface(NamedTuple):
    """Faces in render space. Attributes: axes: (n, 3), smooth normals of the vertices, unit or zero."""

    axes: Float64s
    surface: Surface

    @classmethod
    def of(cls, vertices: Float64s, receivers: Receivers) -> Self:
        """The faces of `receivers` over `vertices` (n, 3)."""
        axes = np.concatenate([receivers.points.normals, np.zeros((1, 3), np.float32)])[receivers.of_vertex]
        normals = face_normals(vertices, receivers.faces)[0]
        return cls(axes.astype(np.float64), Surface.of(vertices, receivers.faces, normals))

    def positions_at(self, face: Int32s, barycentric: Float32s, threads: int) -> Float32s:
        """Positions (k, 3) of points on faces (k,)."""
        positions = np.empty((len(face), 3), np.float32)
        _interpolate.on(threads)(face, barycentric, self.surface.vertices, self.surface.faces, positions)
        return positions

    def points_at(
        self, face: Int32s | Int64s, barycentric: Float32s, threads: int
    ) -> tuple[Float64s, Float64s, Float64s]:
        """Positions (k, 3) of points on faces (k,), their faces' normals on the hemispheres' side, and the axes of
        the hemispheres: the interpolated normals, or the faces' own where these are far from them."""
        positions, normals, axes = np.empty((3, len(face), 3))
        _locate.on(threads)(face, barycentric, self.surface, self.axes, (positions, normals, axes))
        return positions, normals, axes


@each("face", 1 << 10)
def _interpolate(
    i: int,
    face: Int32s,
    barycentric: Float32Rows,
    vertices: Float64Rows,
    faces: Int64Rows,
    positions: Float32Rows,
) -> None:
    """Write the positions of points on faces, by their barycentric coordinates."""
    a, b, c = load_triangle(vertices, faces, face[i])
    u, v, w = load(barycentric, i)
    store(positions, i, add(add(scale(u, a), scale(v, b)), scale(w, c)))


@inline
def point_on(surface, axes, f, barycentric):
    """A point of face `f`: its position, the face's normal on the side of its hemisphere, and the axis of this."""
    x = y = z = nx = ny = nz = 0.0
    for corner in range(3):
        weight = np.float64(barycentric[corner])
        vertex = surface.faces[f, corner]
        p = load(surface.vertices, vertex)
        n = load(axes, vertex)
        x = x + weight * p[0]
        y = y + weight * p[1]
        z = z + weight * p[2]
        nx = nx + weight * n[0]
        ny = ny + weight * n[1]
        nz = nz + weight * n[2]
    # The face's normal on the axis' side; in place of the axis where that is none, or far from it.
    normal = load(surface.normals, f)
    axis = (nx, ny, nz)
    size = np.sqrt(dot(axis, axis))
    cosine = dot(axis, normal)
    if cosine < 0.0:
        normal = scale(-1.0, normal)
        cosine = -cosine
    flat = size < 1e-6 or cosine < _LEAST_COSINE * size or cosine > (1.0 - 1e-12) * size
    return (x, y, z), normal, normal if flat else scale(1.0 / size, axis)


@each("face", 1 << 10)
def _locate(
    i: int,
    face: Int32s | Int64s,
    barycentric: Float32Rows,
    surface: Surface,
    axes: Float64Rows,
    out: tuple[Float64Rows, Float64Rows, Float64Rows],
) -> None:
    """Write `point_on` for points: positions, normals and axes of hemispheres."""
    positions, normals, hemispheres = out
    position, normal, axis = point_on(surface, axes, face[i], barycentric[i])
    store(positions, i, position)
    store(normals, i, normal)
    store(hemispheres, i, axis)
