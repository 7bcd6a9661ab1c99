"""Vertices that are repeated where their corners differ."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..types import Int64s
from .mesh import Mesh, PerCorner
from .normals import corner_normals
from .weld import first_alike


def unique_rows(columns: Sequence[Int64s]) -> tuple[Int64s, Int64s]:
    """The first row (k,) of each kind, in ascending order of the columns (n,), and the kind (n,) of each row."""
    keys = np.stack(columns, axis=1)
    alike = first_alike(keys)
    first_of_kind = np.flatnonzero(alike == np.arange(len(keys)))
    first_of_kind = first_of_kind[np.lexsort(keys[first_of_kind].T[::-1])]
    kind = np.empty(len(keys), np.int64)
    kind[first_of_kind] = np.arange(len(first_of_kind))
    return first_of_kind, kind[alike]


def split_corners(
    corners: Int64s, places: Int64s, several: list[PerCorner], keep: int
) -> tuple[Int64s, Int64s, Int64s]:
    """One vertex for every combination of a vertex with what its corners have; of `keep` vertices all come first.

    Args: places: (m, 3) of triangles in `corners`. Returns: vertices (k,), faces (m, 3), and the place of a corner like
        each of the new vertices (k,).
    """
    flat = places.ravel()
    example, inverse = unique_rows([corners[flat], *(values.of[flat] for values in several)])
    vertices = corners[flat[example]]
    if not keep:
        return vertices, inverse.reshape(-1, 3), flat[example]
    repeated = np.concatenate([[False], vertices[1:] == vertices[:-1]])
    slots = np.where(repeated, keep + np.cumsum(repeated) - 1, vertices)
    whole = np.arange(keep + int(repeated.sum()))
    like = np.full(keep + int(repeated.sum()), flat[0])
    whole[slots] = vertices
    like[slots] = flat[example]
    return whole, slots[inverse].reshape(-1, 3), like


class SplitMesh(NamedTuple):
    """A mesh that has a vertex for each normal of a vertex.

    Attributes:
        mesh: with the given mesh's vertices first, in their order, and one normal each.
        vertices: (k,), the given mesh's vertex that each one is. like: (k,), one of the corners that each one has.
    """

    mesh: Mesh
    vertices: Int64s
    like: Int64s


def split_creases(mesh: Mesh, more: Sequence[PerCorner] = (), own: bool = True) -> SplitMesh:
    """A mesh with a vertex for each of its `corner_normals`, and for `more` that corners have.

    Args: own: whether the mesh's own normals are asked for.
    """
    normals = corner_normals(mesh, own)
    of = normals.of.ravel()
    corners = np.arange(of.size).reshape(-1, 3)
    several = [PerCorner(normals.values, of), *more]
    vertices, faces, like = split_corners(mesh.faces.ravel(), corners, several, len(mesh.vertices))
    facts = {"source": mesh.source, "up": mesh.up, "opacity": mesh.opacity, "polygons": mesh.polygons}
    return SplitMesh(Mesh(mesh.vertices[vertices], faces, normals.values[of[like]], **facts), vertices, like)


def with_hard_edges(mesh: Mesh, own: bool = True) -> Mesh:
    """The mesh of `split_creases`; itself where each vertex has one normal anyway."""
    split = split_creases(mesh, own=own)
    is_whole = len(split.vertices) == len(mesh.vertices) and mesh.corner_normals is None
    return mesh if is_whole else split.mesh
