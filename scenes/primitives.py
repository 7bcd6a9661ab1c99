"""Gridded boxes and cylinders: what the built-in scenes are made of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from raytrace.mesh import Mesh

Floats = npt.NDArray[np.float64]


def merge(meshes: Sequence[Mesh], source: str) -> Mesh:
    """All `meshes` as one, vertices and faces in order."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)])
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), faces, source=source)


def grid(corner: npt.ArrayLike, along: npt.ArrayLike, across: npt.ArrayLike, fineness: float) -> Mesh:
    """A parallelogram with normal along × across, cut into triangles with legs of at most `fineness`."""
    sides = np.asarray([along, across], np.float64)
    cells = [max(int(np.ceil(np.linalg.norm(side) / fineness)), 1) for side in sides]
    s, t = np.meshgrid(*(np.linspace(0, 1, count + 1) for count in cells), indexing="ij")
    vertices = np.asarray(corner, np.float64) + s[..., None] * sides[0] + t[..., None] * sides[1]
    return Mesh(vertices.reshape(-1, 3), _cells(cells[0] + 1, cells[1] + 1), source="grid")


def _cells(rows: int, columns: int) -> npt.NDArray[np.int64]:
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2).reshape(-1, 3)


def box(centre: npt.ArrayLike, size: npt.ArrayLike, fineness: float) -> Mesh:
    """An axis-aligned box, outward normals, its six sides not joined at the edges (hard edges)."""
    sides, extent = [], np.asarray(size, np.float64)
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for sign in (1.0, -1.0):
            low = np.asarray(centre, np.float64) - extent / 2
            along, across = np.zeros(3), np.zeros(3)
            along[u], across[v] = extent[u], extent[v]
            if sign > 0:
                low[axis] += extent[axis]
            else:
                along, across = across, along
            sides.append(grid(low, along, across, fineness))
    return merge(sides, source="box")


def cylinder(base: npt.ArrayLike, radius: float, height: float, fineness: float) -> Mesh:
    """The side of a cylinder that stands on `base` along z, outward normals, no caps."""
    around = max(int(np.ceil(2 * np.pi * radius / fineness)), 8)
    up = max(int(np.ceil(height / fineness)), 1)
    angle, z = np.meshgrid(np.linspace(0, 2 * np.pi, around + 1), np.linspace(0, height, up + 1), indexing="ij")
    vertices = np.asarray(base, np.float64) + np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)
    vertices[-1] = vertices[0]
    return Mesh(vertices.reshape(-1, 3), _cells(around + 1, up + 1), source="cylinder")
