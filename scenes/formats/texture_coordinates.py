"""Texture coordinates of a mesh file by face and corner, as bakes of textures take them."""

from __future__ import annotations

import numpy as np

from raytrace.errors import MeshError
from raytrace.types import Float64s, Int64s

from ..geometry.detail import Detail
from ..geometry.instances import Submesh
from .gltf.accessors import entry, normalized, values
from .gltf.container import Gltf, primitives

ENDINGS = (".obj", ".ply", ".glb", ".gltf")  # of files that can have some


def of_detail(detail: Detail | None) -> Float64s | None:
    """Texture coordinates (m, 3, 2) of the triangles of an OBJ or PLY file, v upwards, NaN where a corner of one
    has none; None if it has none."""
    if detail is None:
        return None
    places = detail.triangles.take(np.arange(len(detail.corners)))
    if detail.some_uv is not None:
        found = detail.some_uv[places]
        return np.where(np.isnan(found).any(axis=(1, 2), keepdims=True), np.nan, found)
    return None if detail.uv is None else detail.uv.rows[detail.uv.of[places]]


def of_gltf(asset: Gltf, parts: tuple[Submesh, ...], faces: Int64s, number: int) -> Float64s | None:
    """The set TEXCOORD_`number` of all drawn primitives by corner (m, 3, 2), v upwards, NaN where one lacks it; None
    if all do.

    Args: parts: the primitives. faces: (m, 3).

    Raises:
        MeshError: values that are not finite, or not one for each vertex.
    """
    name = f"TEXCOORD_{number}"
    pieces = [entry(asset, "meshes", piece.mesh)["primitives"][piece.place] for piece in primitives(asset.header)]
    if not any(name in piece["attributes"] for piece in pieces):
        return None
    downwards = np.full((parts[-1].vertices.stop, 2), np.nan)
    for piece, part in zip(pieces, parts, strict=True):
        if name in piece["attributes"]:
            downwards[part.vertices] = _stored(asset, piece["attributes"][name], part, f"{name} of {part.name}")
    return np.stack([downwards[:, 0], 1 - downwards[:, 1]], axis=1)[faces]


def _stored(asset: Gltf, accessor: int, part: Submesh, field: str) -> Float64s:
    count = part.vertices.stop - part.vertices.start
    try:
        stored = normalized(values(asset, accessor, "VEC2"))
    except (ValueError, KeyError, TypeError) as reason:
        raise MeshError(asset.path, field, "two numbers a vertex", reason) from None
    if len(stored) != count:
        raise MeshError(asset.path, field, f"{count} rows", len(stored))
    if not np.isfinite(stored).all():
        raise MeshError(asset.path, field, "finite numbers", "others")
    return np.asarray(stored, np.float64)
