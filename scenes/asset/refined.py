"""A mesh file whose faces are cut, with all that its vertices and polygons have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from obscurance.ao.refine import Cuts, Halved
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.types import AnyInts, Float64s, Int64s

from .asset import Asset, Node, Part
from .primitive import NORMAL, Array, Column, ColumnSet, Primitive, W


def refined_asset(source: Asset, cuts: Sequence[Cuts]) -> Asset:
    """The asset after cuts of its mesh's faces, of triangles in world space; an earlier bake and what a format stores
    besides are left out."""
    each = zip(source.parts, source.normals, cuts_of_parts(source, cuts), strict=True)
    parts = [_refined(part, source.mesh.vertices[part.vertices], normals, own) for part, normals, own in each]
    nodes = [Node(part.node.name, (number,), None, part.node.body) for number, part in enumerate(source.parts)]
    return replace(source, primitives=tuple(parts), nodes=tuple(nodes), raw=None)


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


def _refined(part: Part, positions: Float64s, normals: Column | None, cuts: Sequence[Cuts]) -> Primitive:
    """A part's primitive after cuts. Args: positions: (n, 3), of its vertices in the world. normals: there, too."""
    primitive = part.primitive
    faces, extended = cut_rows(primitive.faces, len(primitive.positions), cuts)
    parent = np.arange(len(primitive.faces))
    for cut in cuts:
        parent = np.repeat(parent, cut.pieces)

    def column(name: str) -> Column:
        old = normals if name == NORMAL and normals else primitive.columns[name]
        rows, extend = faces, extended
        if old.of is not None:
            rows, extend = cut_rows(primitive.rows(old), len(old.values), cuts)
        values = extend(old.values)
        values = normalize(values) if name == NORMAL else values
        return old._replace(values=values, of=None if old.of is None else rows.ravel())

    columns = ColumnSet({name: partial(column, name) for name in primitive.columns if not name.startswith(W)})
    of_faces = {
        name: None if numbers is None else primitive.of_faces(numbers)[parent]
        for name, numbers in (("material", primitive.material), ("object", primitive.object))
    }
    return Primitive.of(extended(positions), faces.ravel(), columns=columns, name=primitive.name, **of_faces)
