"""The mesh that a texture shows, in the render space of what is baked, itself or a finer mesh; and tangents on it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from raytrace.mesh.mesh import Mesh
from raytrace.mesh.normals import face_normals, normalize
from raytrace.mesh.placement import Placement
from raytrace.types import Float64s, Int64s

from ..points.receivers import Receivers, find_receivers
from ..prepared import Prepared
from .coverage import Coverage
from .projection import Groups, project
from .seams import Seams
from .surface_points import Faces
from .texels import Texels
from .uv_layout import UVLayout, on_page


@dataclass(frozen=True, eq=False)
class Shown:
    """A mesh on a page."""

    vertices: Float64s  # (n, 3)
    receivers: Receivers
    layout: UVLayout  # of the faces that are not degenerate
    points_of_faces: Int64s  # (m', 3), the receivers at the corners of these, −1 for faces that are not on the page

    @classmethod
    def of(cls, mesh: Mesh, uv: Float64s, prepared: Prepared, size: tuple[int, int], wrap: bool) -> Self:
        """`mesh` with texture coordinates `uv` (m, 3, 2) on a page of `size`; `prepared`: of it or of a finer mesh.

        Raises: MeshError: see `UVLayout.of` and `find_receivers`.
        """
        own = Placement.of(mesh)
        receivers, vertices = prepared.receivers, own.vertices.astype(np.float64)
        uv = uv[face_normals(vertices, mesh.faces)[1] > 0]
        if mesh is not prepared.mesh:
            receivers = find_receivers(mesh, own, prepared.options.normals)
            vertices = (mesh.vertices - prepared.placement.centre) * prepared.placement.scale
        layout = UVLayout.of(uv, size, wrap, mesh.source)
        points = np.where(on_page(uv)[:, None], receivers.of_vertex[receivers.faces], -1)
        return cls(vertices, receivers, layout, points)

    @cached_property
    def faces(self) -> Faces:
        return Faces.of(self.vertices, self.receivers)

    @property
    def areas(self) -> Float64s:
        """Of the faces (m',)."""
        return face_normals(self.vertices, self.receivers.faces)[1]

    @cached_property
    def seams(self) -> Seams:
        size = self.layout.width, self.layout.height
        return Seams.find(self.layout.uv, self.points_of_faces, size, self.layout.wraps)

    def project(
        self, page: Coverage, prepared: Prepared, cage: float | Mesh, groups: Groups | None = None
    ) -> tuple[Coverage, Int64s]:
        """`projection.project` of the points of `page`. Args: cage: of `cage_of`. groups: of both meshes' vertices."""
        own = np.append(page.face, page.layer_face).astype(np.int64)
        weights = np.concatenate([page.barycentric.reshape(-1, 3), page.layer_barycentric])
        places, _, axes = self.faces.points_at(own, weights, prepared.threads)
        corners = self.receivers.faces[own]
        starts = cage if isinstance(cage, float) else np.einsum("kc,kci->ki", weights, cage.vertices[corners])
        groups = groups and (np.asarray(groups[0])[corners[:, 0]], groups[1])
        return project(page, places, axes, prepared, starts, groups)


def corner_places(uv: Float64s, points: Int64s) -> Int64s:
    """A number (m, 3) for each corner, the same where they share a welded point of `points` and its place in texels."""
    rounded = np.round(uv.reshape(-1, 2) * 4096).astype(np.int64)
    order = np.lexsort((rounded[:, 1], rounded[:, 0], points.ravel()))
    keys = np.column_stack([points.ravel(), rounded])[order]
    new = np.concatenate([[False], (keys[1:] != keys[:-1]).any(axis=1)])
    corner = np.empty(len(order), np.int64)
    corner[order] = np.cumsum(new)
    return corner.reshape(-1, 3)


def tangent_frames(shown: Shown, texels: Texels) -> Float64s:
    """Frames (k, 3, 3) at what texels show: rows x along u, y along v upwards, z the smooth normal, orthonormal.

    Tangents of vertices are made as by Mikkelsen (2008), Simulation of Wrinkled Surfaces Revisited: means of the faces'
    directions of u in the vertex's tangent plane, weighted by angle, over corners that share place, normal, coordinates
    and handedness.
    """
    uv, faces, face = shown.layout.uv, shown.receivers.faces, texels.shown
    corners = shown.vertices[faces]
    along, up = corners[:, 1:] - corners[:, :1], uv[:, 1:] - uv[:, :1]
    u, v = up[..., 0], -up[..., 1]
    mirrored = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0
    direction = along[:, 0] * v[:, 1:] - along[:, 1] * v[:, :1]
    direction = normalize(np.where(mirrored[:, None], -direction, direction))
    axes = shown.faces.axes[faces]
    unset = ~axes.any(axis=2)
    axes[unset] = np.broadcast_to(shown.faces.surface.normals[:, None], axes.shape)[unset]
    flat = normalize(direction[:, None] - np.einsum("fd,fcd->fc", direction, axes)[..., None] * axes)
    group = 2 * corner_places(uv, shown.points_of_faces) + mirrored[:, None]
    ahead, behind = (normalize(np.roll(corners, -step, axis=1) - corners) for step in (1, 2))
    angles = np.arccos(np.einsum("fcd,fcd->fc", ahead, behind).clip(-1, 1))
    columns = [np.bincount(group.ravel(), column) for column in (angles[..., None] * flat).reshape(-1, 3).T]
    sums: Float64s = np.stack(columns, axis=1).astype(np.float64)
    b = texels.shown_at.astype(np.float64)
    normal = normalize(np.einsum("kc,kcd->kd", b, axes[face]))
    tangent = np.einsum("kc,kcd->kd", b, normalize(sums)[group[face]])
    tangent = normalize(tangent - np.einsum("kd,kd->k", tangent, normal)[:, None] * normal)
    bitangent = np.cross(normal, tangent) * np.where(mirrored[face], -1.0, 1.0)[:, None]
    return np.stack([tangent, bitangent, normal], axis=1)
