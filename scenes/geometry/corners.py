"""Values of polygons' corners, and vertices that are repeated where their corners differ."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from raytrace import Mesh
from raytrace.mesh.normals import creased_normals
from raytrace.mesh.weld import first_alike
from raytrace.types import Float64s, Int64s


class PerCorner(NamedTuple):
    """Values of the polygons' corners: `values` (k, w), and for each corner (c,) which of them it has."""

    values: Float64s
    of: Int64s

    def at_vertices(self, corners: Int64s, count: int, elsewhere: float = 0.0) -> Float64s | None:
        """The values by vertex (count, w), `elsewhere` where no corner is; None if some vertex has several."""
        at_corners = self.values[self.of]
        by_vertex = np.full((count, self.values.shape[1]), elsewhere)
        by_vertex[corners] = at_corners
        return by_vertex if np.array_equal(by_vertex[corners], at_corners, equal_nan=True) else None


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


def split_creases(mesh: Mesh, more: Sequence[PerCorner] = ()) -> tuple[Int64s, Int64s, Float64s, Int64s]:
    """A mesh with a vertex for each normal that `raytrace.mesh.normals` gives, and for `more` that corners have.

    Returns: vertices (k,), the mesh's first, faces (m, 3), normals (k, 3), and a corner like each vertex (k,).
    """
    normals = PerCorner(*creased_normals(mesh))
    normals = normals._replace(of=normals.of.ravel())
    corners = np.arange(normals.of.size).reshape(-1, 3)
    vertices, faces, like = split_corners(mesh.faces.ravel(), corners, [normals, *more], len(mesh.vertices))
    return vertices, faces, normals.values[normals.of[like]], like
