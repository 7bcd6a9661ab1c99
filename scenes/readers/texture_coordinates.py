"""Texture coordinates of a mesh file by face and corner, as bakes of textures take them."""

from __future__ import annotations

import numpy as np

from raytrace.errors import MeshError
from raytrace.types import Float64s

from ..gltf.accessors import entry, normalized, values
from ..gltf.container import Gltf, primitives
from .load import MeshFile

ENDINGS = (".obj", ".ply", ".glb", ".gltf")  # of files that can have some


def texture_coordinates(mesh_file: MeshFile, number: int = 0) -> Float64s | None:
    """Texture coordinates (m, 3, 2) of `mesh_file.mesh`, v upwards; None if the file has none of that number.

    Args:
        mesh_file: loaded for a target that can hold them (`load`).
        number: which, if it is a glTF, whose vertices may have several.

    Raises:
        MeshError: some parts have them and others have not, or their number is not that of the vertices.
    """
    if mesh_file.gltf:
        by_vertex = _of_gltf(mesh_file.gltf, mesh_file, f"TEXCOORD_{number}")
        return None if by_vertex is None else by_vertex[mesh_file.mesh.faces]
    detail = mesh_file.detail
    if detail is None or detail.uv is None or number:
        return None
    return detail.uv.rows[detail.uv.of[detail.triangles.take(np.arange(len(detail.corners)))]]


def _of_gltf(asset: Gltf, mesh_file: MeshFile, name: str) -> Float64s | None:
    pieces = [entry(asset, "meshes", piece.mesh)["primitives"][piece.place] for piece in primitives(asset.header)]
    having = [name in piece["attributes"] for piece in pieces]
    if not any(having):
        return None
    rows = []
    for piece, part, has in zip(pieces, mesh_file.parts, having, strict=True):
        field = f"{name} of {part.name}"
        if not has:
            raise MeshError(mesh_file.path, field, "texture coordinates, for other parts have some", "none")
        try:
            stored = normalized(values(asset, piece["attributes"][name], "VEC2"))
        except (ValueError, KeyError, TypeError) as reason:
            raise MeshError(mesh_file.path, field, "two numbers a vertex", reason) from None
        if len(stored) != part.vertices.stop - part.vertices.start:
            raise MeshError(mesh_file.path, field, f"{part.vertices.stop - part.vertices.start} rows", len(stored))
        rows.append(np.asarray(stored, np.float64))
    downwards = np.concatenate(rows)
    return np.stack([downwards[:, 0], 1 - downwards[:, 1]], axis=1)
