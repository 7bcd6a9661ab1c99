"""Coincident vertices as one point each, with a ray origin in front of the faces of all of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..bvh.bvh16 import BVH16
from ..mesh.normals import Weighting, face_normals, nonzero, normalize, vertex_sums
from ..mesh.weld import CREASE, sum_groups, weld
from ..types import Bools, Float64s, Int64s
from .clearance import SHARP, outermost_normals
from .origins import ray_origins
from .surface import Surface


class WeldedPoints(NamedTuple):
    """Points of a mesh of n vertices and m faces that are not degenerate.

    Attributes:
        group: int64 (n,), the point of each vertex. first: int64 (k,), the first vertex of each point.
        faces: int64 (m, 3), face_normals: float64 (m, 3), unit, face_points: int64 (m, 3), the point at each corner.
        normals: float64 (k, 3), mean of the faces' normals, unit or zero.
        axes: float64 (k, 3), these, moved in front of all the point's faces where there is a way.
        directions: float64 (k, 3), to offset ray origins along, see `raytrace.ray_origins.clearance`.
        clearance: float64 (k,), least cosine between the direction and the faces' normals.
    """

    group: Int64s
    first: Int64s
    faces: Int64s
    face_normals: Float64s
    face_points: Int64s
    normals: Float64s
    axes: Float64s
    directions: Float64s
    clearance: Float64s

    def reversed(self) -> WeldedPoints:
        """The same points of the same faces, seen from behind."""
        return self._replace(face_normals=-self.face_normals, directions=-self.directions)

    def surface(self, vertices: Float64s) -> Surface:
        """The faces in render space. Args: vertices: (n, 3)."""
        return Surface.of(vertices, self.faces, self.face_normals)

    def ray_origins(self, tree: BVH16, surface: Surface) -> tuple[Float64s, Bools]:
        """`raytrace.ray_origins.origins.ray_origins`. Args: tree: over the faces of `surface`, `self.surface`."""
        points, corners, numbers = surface.vertices, self.face_points, np.arange(len(self.first))
        if len(numbers) < len(points):
            points = points.take(self.first, axis=0)
        magnitude = surface.magnitudes(corners, len(numbers))
        return ray_origins(tree, surface, points, self.directions, self.clearance, corners, numbers, magnitude)

    def displacement(self, surface: Surface, origins: Float64s) -> Float64s:
        """Distances (k,) of origins (k, 3) from points in folds as sharp as `SHARP`, in shortest edges; elsewhere 0."""
        found, sharp = np.zeros(len(self.first)), np.flatnonzero(nonzero(self.directions) & (self.clearance < SHARP))
        if len(sharp):
            away = np.linalg.norm(origins[sharp] - surface.vertices[self.first[sharp]], axis=1)
            found[sharp] = away / surface.shortest_edges(self.face_points, sharp)
        return found


def weld_points(
    vertices: Float64s,
    faces: Int64s,
    weighting: Weighting = "angle",
    normals: Float64s | None = None,
    agreement: float = CREASE,
) -> WeldedPoints:
    """Weld the vertices of a mesh, and find directions in front of their faces.

    Args:
        vertices: (n, 3), render space.
        faces: int64 (m, 3); degenerate ones are left out.
        weighting: of the faces' normals in their mean, see `vertex_sums`.
        normals: (n, 3), unit or zero, on whose side of the surface the directions are; by default the vertices' means.
        agreement: least cosine between the normals of vertices that are welded.
    """
    face_normal, area = face_normals(vertices, faces)
    sums = vertex_sums(vertices, faces, face_normal, area, weighting)
    if not area.all():
        faces, face_normal = faces[area > 0], face_normal[area > 0]
    mean = normalize(sums)
    group = weld(vertices.astype(np.float32), faces, mean if normals is None else normals, agreement)
    first, face_points = group, np.ascontiguousarray(faces)
    if len(group) > group.max() + 1:
        first = np.empty(int(group.max()) + 1, np.int64)
        first[group[::-1]] = np.arange(len(group))[::-1]
        face_points, mean = group.take(faces), normalize(sum_groups(group, sums))
    axes, directions, clearance = outermost_normals(mean, face_points, face_normal)
    if normals is not None:
        behind = np.einsum("ij,ij->i", directions, normals[first]) < 0
        directions = np.where(behind[:, None], -directions, directions)
    return WeldedPoints(group, first, faces, face_normal, face_points, mean, axes, directions, clearance)
