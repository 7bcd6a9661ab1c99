"""Points on faces whose normals are interpolated between vertices: positions, normals, axes of hemispheres."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.kernel.vector import add, dot, length, load, load_triangle, scale, store, subtract, unit
from obscurance.raytrace.mesh.weld import CREASE
from obscurance.raytrace.ray_origins.surface import Surface, front
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import AnyInts, Float32Rows, Float32s, Float64Rows, Float64s, Int32Rows, Int32s, Int64s

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


class LocatedPoints(NamedTuple):
    """k points on faces.

    Attributes:
        positions: float64 (k, 3). normals: float64 (k, 3), of the faces, on their fronts.
        axes: float64 (k, 3), unit, of hemispheres.
        cosines: float64 (k,), between each axis and the normal of the surface, below which directions are closed.
    """

    positions: Float64Rows
    normals: Float64Rows
    axes: Float64Rows
    cosines: Float64s


class VertexAxes(NamedTuple):
    """Axes of hemispheres (n, 3) at vertices, and the normals (n, 3) of the smooth surface, unit or zero."""

    axes: Float64Rows
    normals: Float64Rows

    @classmethod
    def of(cls, receivers: Receivers, points: AnyInts) -> Self:
        """The axes and normals at some of the receivers' points (n,), zero for −1."""
        vectors = receivers.points.normals, receivers.surface_normals
        none = np.zeros((1, 3), np.float32)
        return cls(*(np.concatenate([of_points, none])[points].astype(np.float64) for of_points in vectors))


class SmoothSurface(NamedTuple):
    """Faces in render space, their normals on their fronts, and the axes of their vertices."""

    axes: VertexAxes
    surface: Surface

    @classmethod
    def of(cls, vertices: Float64s, receivers: Receivers) -> Self:
        """The faces of `receivers` over `vertices` (n, 3)."""
        faces = Surface.of(vertices, receivers.faces, receivers.backwards)
        return cls(VertexAxes.of(receivers, receivers.of_vertex), faces)

    def positions_at(self, face: Int32s, barycentric: Float32s, threads: int) -> Float32s:
        """Positions (k, 3) of points on faces (k,)."""
        positions = np.empty((len(face), 3), np.float32)
        _interpolate.on(threads)(face, barycentric, self.surface.vertices, self.surface.faces, positions)
        return positions

    def points_at(self, face: Int32s | Int64s, barycentric: Float32s, threads: int) -> LocatedPoints:
        """Points on faces (k,)."""
        positions, normals, axes = np.empty((3, len(face), 3))
        located = LocatedPoints(positions, normals, axes, np.empty(len(face)))
        _locate.on(threads)(face, barycentric, self.surface, self.axes, located)
        return located


@each("face", 1 << 10)
def _interpolate(
    i: int,
    face: Int32s,
    barycentric: Float32Rows,
    vertices: Float32Rows | Float64Rows,
    faces: Int32Rows,
    positions: Float32Rows,
) -> None:
    """Write the positions of points on faces, by their barycentric coordinates."""
    a, b, c = load_triangle(vertices, faces, face[i])
    u, v, w = load(barycentric, i)
    store(positions, i, add(add(scale(u, a), scale(v, b)), scale(w, c)))


@inline
def point_on(surface, vertex_axes, f, barycentric):
    """A point of face `f`: its position, the face's normal on its front, the axis of its hemisphere, and the cosine of
    the angle by which this leans away from the surface.

    Computed normals are the smooth surface's own: the cosine is 1, and the face's front is the side that they are on.
    Where they are zero, or nearly within the face, the face's normal is the axis.
    """
    p = _interpolated(surface.vertices, surface.faces, f, barycentric)
    axis = _interpolated(vertex_axes.axes, surface.faces, f, barycentric)
    smooth = _interpolated(vertex_axes.normals, surface.faces, f, barycentric)
    normal = front(surface, f)
    size = length(axis)
    cosine = dot(axis, normal)
    is_own = axis == smooth
    if is_own and cosine < 0.0:
        normal = scale(-1.0, normal)
        cosine = -cosine
    far = is_own and (cosine < _LEAST_COSINE * size or cosine > (1.0 - 1e-12) * size)
    if far or size < 1e-6:
        return p, normal, normal, 1.0
    axis = scale(1.0 / size, axis)
    return p, normal, axis, 1.0 if is_own else leaning(axis, normal, smooth)


@inline
def _interpolated(values, faces, f, barycentric):
    """The triple interpolated between the rows of `values` (n, 3) at the corners of a face."""
    total = (0.0, 0.0, 0.0)
    for corner in range(3):
        total = add(total, scale(np.float64(barycentric[corner]), load(values, faces[f, corner])))
    return total


@inline
def leaning(axis, normal, smooth):
    """The cosine between an axis and the nearest normal on the arc from a face's to the smooth surface's, or to the
    face's, if the axis is far from either: then it is no normal of theirs."""
    cosine = dot(axis, normal)
    if cosine < _LEAST_COSINE or dot(axis, smooth) < CREASE * length(smooth) or length(smooth) < 1e-6:
        return cosine
    smooth = unit(smooth)
    aside = subtract(smooth, scale(dot(smooth, normal), normal))
    if length(aside) < 1e-6:
        return cosine
    aside = unit(aside)
    angle = np.arctan2(dot(axis, aside), cosine)
    if angle <= 0.0:
        return cosine
    if angle >= np.arctan2(dot(smooth, aside), dot(smooth, normal)):
        return dot(axis, smooth)
    return np.sqrt(cosine**2 + dot(axis, aside) ** 2)


@each("face", 1 << 10)
def _locate(
    i: int,
    face: Int32s | Int64s,
    barycentric: Float32Rows,
    surface: Surface,
    vertex_axes: VertexAxes,
    out: LocatedPoints,
) -> None:
    """Write `point_on` for points, `LocatedPoints`."""
    position, normal, axis, cosine = point_on(surface, vertex_axes, face[i], barycentric[i])
    store(out.positions, i, position)
    store(out.normals, i, normal)
    store(out.axes, i, axis)
    out.cosines[i] = cosine
