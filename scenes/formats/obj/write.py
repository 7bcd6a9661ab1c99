"""Obscurance as vertex colours of a Wavefront OBJ, `v x y z r g b`, which MeshLab, Blender and ZBrush read."""

from collections.abc import Iterator
from itertools import pairwise, repeat

import numpy as np

from obscurance.ao import Bake
from obscurance.raytrace.image.colour import encode_srgb
from obscurance.raytrace.mesh.mesh import PerCorner
from obscurance.raytrace.types import AnyFloats, Int64s

from ...asset.asset import Asset
from .text import Obj


def obj(bake: Bake, asset: Asset, _: object) -> bytes:
    """The vertices in their order, grey w, sRGB-encoded as programs take such colours; the source's polygons, texture
    coordinates and normals of corners, and names of objects and materials; of an OBJ its statements between faces."""
    mesh = asset.mesh
    grey = np.repeat(encode_srgb(bake.w)[:, None], 3, axis=1).astype(np.float64).round(6)
    lines = ["# obscurance: 1 = open; r g b = obscurance as sRGB", *_lines("v", np.hstack([mesh.vertices, grey]))]
    uv, of_uv = _numbered(asset.of_polygons("uv0"))
    of_vertices = None if mesh.normals is None else PerCorner(np.nan_to_num(mesh.normals), asset.corners)
    normals, of_normals = _numbered(of_vertices or asset.corner_normals)
    lines += [*_lines("vt", uv), *_lines("vn", normals)]
    corners = zip((asset.corners + 1).tolist(), of_uv or repeat(0), of_normals or repeat(0), strict=False)
    tokens = [f"{v}/{t or ''}/{n}" if n else f"{v}/{t}" if t else str(v) for v, t, n in corners]
    faces = [" ".join(["f", *tokens[begin:end]]) for begin, end in pairwise([0, *np.cumsum(asset.sizes).tolist()])]
    begun = 0
    for place, statement in _statements(asset):
        lines += [*faces[begun:place], statement]
        begun = place
    return "\n".join([*lines, *faces[begun:], ""]).encode()


def _numbered(values: PerCorner | None) -> tuple[AnyFloats, list[int]]:
    """The rows of values without NaN (k, w), and the number of the row of each corner (c,) from 1 on, 0 for none."""
    if values is None:
        return np.empty((0, 0)), []
    there = np.isfinite(values.values).all(axis=1)
    return values.values[there], np.where(there, np.cumsum(there), 0)[values.of].tolist()


def _statements(asset: Asset) -> Iterator[tuple[int, str]]:
    """Statements that name the faces after them, each with how many come before."""
    if isinstance(asset.raw, Obj):
        yield from ((run.faces, run.text) for run in asset.raw.runs)
        return
    materials = [*(material.name for material in asset.materials), ""]
    start = 0
    for part in asset.parts:
        count = len(part.primitive.sizes)
        kinds = np.stack([_of_polygons(of, count) for of in (part.primitive.object, part.primitive.material)])
        begins = np.flatnonzero((kinds[:, 1:] != kinds[:, :-1]).any(axis=0)) + 1
        before = -1
        for place in [0, *begins.tolist()]:
            within, material = kinds[:, place].tolist() if count else (-1, -1)
            if len(asset.objects) > 1 and (not place or within != before):
                yield start + place, f"o {(*asset.names, '')[within] or part.name}"
            if asset.materials:
                yield start + place, f"usemtl {materials[material]}".rstrip()
            before = within
        start += count


def _of_polygons(numbers: Int64s | None, count: int) -> Int64s:
    return np.broadcast_to(np.int64(-1), count) if numbers is None else numbers


def _lines(keyword: str, vectors: AnyFloats) -> Iterator[str]:
    """Lines of a keyword and numbers, a vector each."""
    return (" ".join([keyword, *map(repr, row)]) for row in vectors.tolist())
