"""Meshes of other libraries as meshes, recognised by their attributes, so that no such library is imported."""

import os
from typing import Any

import numpy as np

from ..errors import MeshError
from ..types import Int64s
from .mesh import Mesh

_OF_SURFACES = ("triangle", "quad")
_SKIPPED = ("vertex", "line")


def mesh_of(given: Mesh | Any, source: str) -> Mesh:
    """A mesh, made of anything else that has one; vertices keep their order and number.

    Args:
        given: a `Mesh`; a pair of arrays, vertices (n, 3) and faces (m, 3); or an object with `vertices` and `faces`,
            as trimesh has them, with `points` and the padded `faces` of `pyvista.PolyData`, with `points` and the
            `cells` of meshio, triangles or quads, or a triangle mesh of Open3D, legacy or tensor. Polygons are cut into
            triangles.
        source: what to call it in messages.

    Raises:
        MeshError: it has no triangles, or they are no mesh.
    """
    if isinstance(given, Mesh):
        return given
    if isinstance(given, tuple | list) and len(given) == 2:
        return Mesh(*given, source=source)
    if hasattr(given, "vertices") and hasattr(given, "faces"):
        return Mesh(given.vertices, given.faces, source=source)
    if hasattr(given, "points") and hasattr(given, "strips"):
        triangles = given if given.is_all_triangles else given.triangulate()
        return Mesh(triangles.points, np.reshape(triangles.faces, (-1, 4))[:, 1:], source=source)
    if hasattr(given, "points") and isinstance(getattr(given, "cells", None), list):
        return Mesh(given.points, _triangles(given, source), source=source)
    if hasattr(given, "vertices") and hasattr(given, "triangles"):
        return Mesh(given.vertices, given.triangles, source=source)
    if hasattr(given, "vertex") and hasattr(given, "triangle"):
        return Mesh(*_tensors(given, source), source=source)
    methods = "extract_surface", "combine", "to_mesh"
    nearest = next((f"its {name}()" for name in methods if hasattr(given, name)), None)
    if isinstance(given, str | os.PathLike):
        nearest = f'scenes.load("{os.fspath(given)}").mesh'
    expected = "a raytrace.Mesh, a pair (vertices, faces), or a mesh of trimesh, PyVista, meshio or Open3D"
    raise MeshError(source, "mesh", expected, " ".join(repr(given).split()), nearest=nearest)


def _tensors(given: Any, source: str) -> tuple[Any, Any]:
    """Vertices and faces of Open3D's tensor mesh, from whatever device. Raises: MeshError: it has none."""
    try:
        return given.vertex["positions"].cpu().numpy(), given.triangle["indices"].cpu().numpy()
    except KeyError:
        raise MeshError(source, "mesh", "vertex.positions and triangle.indices", "an empty mesh") from None


def _triangles(given: Any, source: str) -> Int64s:
    """The triangles of meshio's cells, quads cut along the diagonal that lies inside of them.

    Raises: MeshError: no cells, or cells of another kind.
    """
    parts = []
    for block in given.cells:
        if block.type in _SKIPPED:
            continue
        if block.type not in _OF_SURFACES:
            raise MeshError(source, "cells", "triangle or quad", block.type)
        parts.append(
            block.data if block.type == "triangle" else _halves(np.asarray(given.points, np.float64), block.data)
        )
    if not parts:
        raise MeshError(source, "cells", "triangle or quad", "none of them")
    return np.concatenate(parts).astype(np.int64)


def _halves(points: Any, quads: Any) -> Any:
    """Two triangles (2k, 3) for each of the quads (k, 4): both turn the same way."""
    a, b, c, d = (points[quads[:, corner]] for corner in range(4))
    folds = (np.cross(b - a, c - a) * np.cross(c - a, d - a)).sum(axis=1) < 0
    turned = np.where(folds[:, None], np.roll(quads, -1, axis=1), quads)
    return np.stack([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
