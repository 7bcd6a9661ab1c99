"""The mesh that a texture shows, in the render space of what is baked, itself or a finer mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.normals import face_areas
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.mesh.weld import connected_components
from obscurance.raytrace.types import AnyInts, Float64s, Int64s

from ..points.receivers import Receivers, find_receivers
from ..points.smooth_surface import SmoothSurface
from ..prepared import Prepared
from .uv_layout import UVLayout, on_page

if TYPE_CHECKING:
    from .covered_texels import Coverage
    from .seams import Seams, Shown


@dataclass(frozen=True, eq=False)
class UVSurface:
    """A mesh on a page."""

    vertices: Float64s  # (n, 3)
    receivers: Receivers
    layout: UVLayout  # of the faces that are not degenerate
    face_points: (
        Int64s  # (m', 3), the receivers at the corners of the layout's faces, −1 for faces that are not on the page
    )

    @classmethod
    def of(cls, mesh: Mesh, uv: Float64s, prepared: Prepared, size: tuple[int, int], wrap: bool) -> Self:
        """`mesh` with texture coordinates `uv` (m, 3, 2) on a page of `size`; `prepared`: of `mesh` or of a finer mesh.

        Raises: MeshError: see `UVLayout.of` and `find_receivers`.
        """
        placement = Placement.of(mesh)
        receivers, vertices = prepared.receivers, placement.vertices.astype(np.float64)
        uv = uv[face_areas(vertices, mesh.faces) > 0]
        if mesh is not prepared.mesh:
            receivers = find_receivers(mesh, placement, prepared.options.normals)
            vertices = (mesh.vertices - prepared.placement.centre) * prepared.placement.scale
        layout = UVLayout.of(uv, size, wrap, mesh.source)
        points = np.where(on_page(uv)[:, None], receivers.of_vertex[receivers.faces], np.int64(-1))
        return cls(vertices, receivers, layout, points)

    @cached_property
    def smooth(self) -> SmoothSurface:
        return SmoothSurface.of(self.vertices, self.receivers)

    @property
    def areas(self) -> Float64s:
        """The areas of the faces (m',)."""
        return face_areas(self.vertices, self.receivers.faces)

    @cached_property
    def charts(self) -> Int64s:
        """The number (m',) of each face's chart: the faces that hang together on the page."""
        corners = corner_places(self.layout.uv, self.face_points)
        return connected_components(corners, int(corners.max()) + 1)[corners[:, 0]]

    @cached_property
    def seams(self) -> Seams:
        from .seams import Seams  # whose sparse matrices load for a fifth of a second

        size = self.layout.width, self.layout.height
        return Seams.find(self.layout.uv, self.face_points, size, self.layout.wraps)

    def shown_near_seams(self, coverage: Coverage, threads: int) -> Shown:
        """Points that the texels near seams show."""
        from .seams import Shown

        return Shown.near(self.seams, coverage, self.areas, threads)


def corner_places(uv: Float64s, points: AnyInts) -> Int64s:
    """A number (m, 3) for each corner, equal where corners share both a welded point and a place in texels.

    Args:
        points: (m, 3), the welded points.
    """
    rounded = np.round(uv.reshape(-1, 2) * 4096).astype(np.int64)
    order = np.lexsort((rounded[:, 1], rounded[:, 0], points.ravel()))
    keys = np.column_stack([points.ravel(), rounded])[order]
    new = np.concatenate([[False], (keys[1:] != keys[:-1]).any(axis=1)])
    corner = np.empty(len(order), np.int64)
    corner[order] = np.cumsum(new)
    return corner.reshape(-1, 3)
