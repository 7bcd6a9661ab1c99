"""Meshes that occlude and are not baked, a ground plane for one."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from obscurance.raytrace.errors import ConflictError, OptionError
from obscurance.raytrace.mesh.mesh import UP, Mesh, mesh_of, up_axis
from obscurance.raytrace.mesh.normals import own_vertex_normals
from obscurance.raytrace.mesh.opacity import Opacity

_EXTENT = 1024.0  # to each side, of the mesh's radius and its height: 1e-6 of a hemisphere looks past it
_GAP = 2.0**-12  # of the radius, below the lowest vertex: faces that stand on the ground are not in it


def ground(mesh: Mesh | Any, height: float | None = None, up: str | None = None) -> Mesh:
    """A plane under `mesh`, two triangles so large that they occlude like an endless one.

    Args:
        mesh: as `ao.bake` takes it.
        height: along the up axis, in mesh units; None: just below the lowest vertex that a face uses.
        up: the up axis, by default that of the mesh, or "y".

    Raises:
        OptionError: a height that is not finite or through the mesh; no axis.
        MeshError: `mesh` is none.
    """
    mesh = mesh_of(mesh, "ground")
    axis = np.array(UP[up_axis(mesh, up)])
    lowest = float((mesh.used @ axis).min())
    radius = mesh.radius or 1.0
    if height is None:
        height = lowest - _GAP * radius
    if not isinstance(height, int | float | np.number) or not -np.inf < height <= lowest:
        raise OptionError("ground", f"a height up to {lowest:g}, that of the lowest vertex", height, mesh.source)
    centre = mesh.centre - (mesh.centre @ axis - height) * axis
    u = np.roll(axis, 1)
    v = np.roll(axis, 2) * axis.sum()  # u × v is the axis
    corners = [u + v, v - u, -u - v, u - v]
    vertices = centre + _EXTENT * (radius + lowest - height) * np.array(corners)
    return Mesh(vertices, [[0, 1, 2], [0, 2, 3]], source="ground")


def occluding(occluders: Sequence[Mesh | Any], high: Mesh | Any | None) -> list[Mesh]:
    """The `occluders` of a bake. Raises: MeshError: one is no mesh; ConflictError: with a finer mesh `high`."""
    if high is not None and len(occluders):
        raise ConflictError("occluders", "does not go with", "high")
    return [mesh_of(occluder, "occluders") for occluder in occluders]


def joined(meshes: Sequence[Mesh], all_normals: bool = False) -> Mesh:
    """Meshes as one, with the name of the first; normals of their own are those of the first alone, or all of them."""
    main = meshes[0]
    if len(meshes) == 1:
        return main
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate([mesh.faces for mesh in meshes])
    counts = [len(mesh.faces) for mesh in meshes]
    before = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    sources = meshes if all_normals else meshes[:1]
    own = [own_vertex_normals(mesh) for mesh in sources]
    normals = np.zeros(vertices.shape) if any(each is not None for each in own) else None
    for start, each in zip(before, own, strict=False):
        if normals is not None and each is not None:
            normals[start : start + len(each)] = each
    opacity = Opacity.joined([mesh.opacity for mesh in meshes], counts)
    faces += np.repeat(before, counts)[:, None]
    return Mesh(vertices, faces, normals, source=main.source, up=main.up, opacity=opacity)
