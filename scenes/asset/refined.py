"""A mesh file whose faces are cut, with all that its vertices and polygons have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from obscurance.ao.refine import Cuts, Halved
from obscurance.raytrace.mesh.corners import SplitMesh
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.types import AnyInts, Int64s

from .asset import Asset, Node, Part
from .primitive import NORMAL, Array, Column, ColumnSet, Primitive, W


def refined_asset(source: Asset, split: SplitMesh, cuts: Sequence[Cuts]) -> Asset:
    """The asset after cuts of its mesh's faces, of triangles in world space with a vertex for each side of hard edges;
    an earlier bake and what a format stores besides are left out.

    Args: split: of its mesh. cuts: of the faces of either.
    """
    each = zip(source.parts, cuts_of_parts(source, cuts), strict=True)
    nodes = [Node(part.node.name, (number,), None, part.node.body) for number, part in enumerate(source.parts)]
    primitives = tuple(_refined(part, split, own) for part, own in each)
    return replace(source, primitives=primitives, nodes=tuple(nodes), raw=None)


def cuts_of_parts(source: Asset, cuts: Sequence[Cuts]) -> list[list[Cuts]]:
    """Cuts of the mesh's faces as those of each part."""
    of_parts: list[list[Cuts]] = [[] for _ in source.parts]
    bounds = np.array([0, *(part.faces.stop for part in source.parts)])
    for cut in cuts:
        for own, start, stop in zip(of_parts, bounds[:-1], bounds[1:], strict=True):
            own.append(Cuts(cut.marked[start:stop], cut.longest[start:stop]))
        bounds = np.concatenate([[0], np.cumsum(cut.pieces)])[bounds]
    return of_parts


def cut_rows(corners: AnyInts, count: int, cuts: Sequence[Cuts]) -> tuple[Int64s, Callable[[Array], Array]]:
    """The rows (m', 3) of the faces' corners after cuts, and what makes the values (n', …) of the rows from those that
    were. Args: corners: (m, 3), of `count` rows."""
    made: list[Halved] = []
    for cut in cuts:
        made.append(Halved.of(corners, count, cut))
        corners = made[-1].corners
        count += len(made[-1].ends)

    def extended(values: Array) -> Array:
        for halved in made:
            values = halved.extended(values)
        return values

    return np.asarray(corners, np.int64), extended


def _refined(part: Part, split: SplitMesh, cuts: Sequence[Cuts]) -> Primitive:
    """A part's primitive after cuts."""
    primitive = part.primitive
    rows, corners = np.unique(split.mesh.faces[part.faces], return_inverse=True)
    faces, extended = cut_rows(corners.reshape(-1, 3), len(rows), cuts)
    parent = np.arange(len(primitive.faces))
    for cut in cuts:
        parent = np.repeat(parent, cut.pieces)

    def column(name: str) -> Column:
        old = primitive.columns[name]
        if old.of is None:
            return old._replace(values=extended(old.values[split.vertices[rows] - part.vertices.start]))
        of, extend = cut_rows(primitive.rows(old), len(old.values), cuts)
        return old._replace(values=extend(old.values), of=of.ravel())

    kept = [name for name in primitive.columns if not name.startswith(W) and name != NORMAL]
    columns = ColumnSet({name: partial(column, name) for name in kept})
    columns |= {NORMAL: Column(normalize(extended(split.normals[rows])))}
    of_faces = {
        name: None if numbers is None else primitive.of_faces(numbers)[parent]
        for name, numbers in (("material", primitive.material), ("object", primitive.object))
    }
    positions = extended(split.mesh.vertices[rows])
    return Primitive.of(positions, faces.ravel(), columns=columns, name=primitive.name, **of_faces)
