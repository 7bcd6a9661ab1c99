"""The mesh that a texture shows, in the render space of what is baked: itself, or a finer mesh at its place."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from raytrace.mesh.mesh import Mesh
from raytrace.mesh.normals import face_normals
from raytrace.mesh.placement import Placement
from raytrace.types import Float64s, Int64s

from ..points.receivers import Receivers, find_receivers
from ..prepared import Prepared
from .seams import Seams
from .surface_points import Faces
from .uv_layout import UVLayout, on_page


@dataclass(frozen=True, eq=False)
class Shown:
    """Attributes:
    vertices: float64 (n, 3). receivers: of this mesh. layout: of its faces that are not degenerate.
    points_of_faces: int64 (m', 3), the receivers at the corners of the faces, −1 for faces that are not on the page.
    """

    vertices: Float64s
    receivers: Receivers
    layout: UVLayout
    points_of_faces: Int64s

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
        """The faces that are not degenerate."""
        return Faces.of(self.vertices, self.receivers)

    @cached_property
    def seams(self) -> Seams:
        """The edges that lie at two places of the page."""
        size = self.layout.width, self.layout.height
        return Seams.find(self.layout.uv, self.points_of_faces, size, self.layout.wraps)
