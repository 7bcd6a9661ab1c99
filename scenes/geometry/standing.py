"""Whether a mesh stands on the axis that is taken for up, where its file names none."""

import numpy as np

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.normals import face_normals

_FLAT = 1e-3  # of the mesh's size, that corners of faces at its bottom may be apart in height
_BASE, _NO_BASE = 0.5, 0.05  # of the bounding box's bottom, that faces at it have an area of


def lying_notes(mesh: Mesh, up: str | None = None) -> list[str]:
    """A line if y is up for want of a better axis, and the mesh has a flat base across z and none across y.

    Args: up: the axis that was asked for.
    """
    if up or mesh.up or not mesh.bounds[1][2] > mesh.bounds[0][2]:
        return []
    if _base(mesh, 2) < _BASE or _base(mesh, 1) > _NO_BASE:
        return []
    return [f"{mesh.source}: y is taken for up, but the mesh seems to lie on its side: --up z"]


def _base(mesh: Mesh, axis: int) -> float:
    """The area of faces at the bottom along an axis, as a share of the bounding box's bottom."""
    low, high = mesh.bounds
    size = high - low
    heights = mesh.vertices[mesh.faces][:, :, axis] - low[axis]
    at_bottom = (heights <= _FLAT * size.max()).all(axis=1)
    bottom = float(np.prod(np.delete(size, axis)))
    areas = face_normals(mesh.vertices, mesh.faces[at_bottom])[1]
    return float(areas.sum()) / bottom if bottom > 0 else 0.0
