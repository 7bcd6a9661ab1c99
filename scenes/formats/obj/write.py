"""Obscurance as vertex colours of a Wavefront OBJ, `v x y z r g b`, which MeshLab, Blender and ZBrush read."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from obscurance.ao import Bake
from obscurance.raytrace.image.colour import encode_srgb
from obscurance.raytrace.types import AnyFloats

from ...asset.asset import Asset


def obj(bake: Bake, asset: Asset, _: object) -> bytes:
    """The vertices in their order, grey w, sRGB-encoded as programs take such colours; the source's polygons, texture
    coordinates and normals of vertices."""
    mesh = asset.mesh
    grey = np.repeat(encode_srgb(bake.w)[:, None], 3, axis=1).astype(np.float64).round(6)
    lines = ["# obscurance: 1 = open; r g b = obscurance as sRGB", *_lines("v", np.hstack([mesh.vertices, grey]))]
    vertex = list(map(str, (asset.corners + 1).tolist()))
    tokens = vertex
    uv = asset.uv_of_polygons()
    if uv and np.isfinite(uv.values).all():
        lines += _lines("vt", uv.values)
        tokens = [f"{token}/{number}" for token, number in zip(tokens, (uv.of + 1).tolist(), strict=True)]
    if mesh.normals is not None:
        lines += _lines("vn", np.nan_to_num(mesh.normals))
        between = "/" if tokens is not vertex else "//"
        tokens = [f"{token}{between}{number}" for token, number in zip(tokens, vertex, strict=True)]
    ends = np.cumsum(asset.sizes).tolist()
    lines += (" ".join(["f", *tokens[begin:end]]) for begin, end in pairwise([0, *ends]))
    return "\n".join([*lines, ""]).encode()


def _lines(keyword: str, vectors: AnyFloats) -> Iterator[str]:
    """Lines of a keyword and numbers, a vector each."""
    return (" ".join([keyword, *map(repr, row)]) for row in vectors.tolist())
