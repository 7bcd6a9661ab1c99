"""Vertices that are repeated where their corners differ."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..types import AnyInts, Float64s, Int64s
from .mesh import Mesh, PerCorner
from .normals import corner_normals
from .weld import first_alike


def unique_rows(columns: Sequence[AnyInts]) -> tuple[Int64s, Int64s]:
    """The first row (k,) of each kind, in ascending order of the columns (n,), and the kind (n,) of each row."""
    keys = np.stack(columns, axis=1)
    alike = first_alike(keys)
    first_of_kind = np.flatnonzero(alike == np.arange(len(keys)))
    first_of_kind = first_of_kind[np.lexsort(keys[first_of_kind].T[::-1])]
    kind = np.empty(len(keys), np.int64)
    kind[first_of_kind] = np.arange(len(first_of_kind))
    return first_of_kind, kind[alike]


def split_corners(
    corners: AnyInts, places: Int64s, several: list[PerCorner], keep: int
) -> tuple[Int64s, Int64s, Int64s]:
    """One vertex for every combination of a vertex with what its corners have; of `keep` vertices all come first.

    Args: places: (m, 3) of triangles in `corners`. Returns: vertices (k,), faces (m, 3), and the place of a corner like
        each of the new vertices (k,).
    """
    flat = places.ravel()
    example, inverse = unique_rows([corners[flat], *(values.of[flat] for values in several)])
    vertices = corners[flat[example]].astype(np.int64)
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
        mesh: with the given mesh's vertices first, in their order. normals: (k, 3), its own, one each.
        vertices: (k,), the given mesh's vertex that each one is. like: (k,), one of the corners that each one has.
    """

    mesh: Mesh
    normals: Float64s
    vertices: Int64s
    like: Int64s


def split_creases(mesh: Mesh, more: Sequence[PerCorner] = (), own: bool = True) -> SplitMesh:
    """A mesh with a vertex for each of its `corner_normals`, and for `more` that corners have.

    Args: own: whether the mesh's own normals are asked for.
    """
    return _split(mesh, corner_normals(mesh, own), more)


def split_hard_edges(mesh: Mesh, own: bool = True) -> SplitMesh | None:
    """`split_creases`; None where each vertex has one normal anyway."""
    normals = corner_normals(mesh, own)
    is_whole = mesh.corner_normals is None and not len(_of_several(mesh, normals))
    return None if is_whole else _split(mesh, normals)


def with_hard_edges(mesh: Mesh, own: bool = True) -> Mesh:
    """The mesh of `split_hard_edges`, or the mesh itself."""
    split = split_hard_edges(mesh, own)
    return split.mesh if split else mesh


def on_hard_edges(mesh: Mesh) -> Int64s:
    """The vertices (k,) whose corners differ in their `corner_normals`."""
    return _of_several(mesh, corner_normals(mesh))


def _of_several(mesh: Mesh, normals: PerCorner) -> Int64s:
    """The vertices (k,) of which some corners have other `normals` than others."""
    corners, of = mesh.faces.ravel(), normals.of.ravel()
    of_vertex = np.zeros(len(mesh.vertices), np.int64)
    of_vertex[corners] = of
    doubtful = np.flatnonzero(of_vertex[corners] != of)
    values = normals.values
    differs = (values[of_vertex[corners[doubtful]]] != values[of[doubtful]]).any(axis=1)
    has_several = np.zeros(len(mesh.vertices), np.bool_)
    has_several[corners[doubtful[differs]]] = True
    return np.flatnonzero(has_several)


def _split(mesh: Mesh, normals: PerCorner, more: Sequence[PerCorner] = ()) -> SplitMesh:
    """A mesh with a vertex for each of its `normals` at corners, and for `more` that corners have."""
    of = normals.of.ravel()
    corners = np.arange(of.size).reshape(-1, 3)
    several = [PerCorner(normals.values, of), *more]
    vertices, faces, like = split_corners(mesh.faces.ravel(), corners, several, len(mesh.vertices))
    facts: dict[str, Any] = {"source": mesh.source, "up": mesh.up, "opacity": mesh.opacity, "polygons": mesh.polygons}
    at_vertices = normals.values[of[like]]
    return SplitMesh(Mesh(mesh.vertices[vertices], faces, at_vertices, **facts), at_vertices, vertices, like)
