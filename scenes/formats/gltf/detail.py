"""Texture coordinates and colours of a glTF file's vertices, for formats that hold nothing else of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from raytrace.errors import MeshError
from raytrace.image.srgb import encode_srgb
from raytrace.types import Float64s

from ...geometry.detail import Detail, PerCorner
from ...geometry.instances import Instance
from ...geometry.polygons import Triangulation
from ..glb.occlusion import ramp_sets
from .accessors import normalized, values
from .container import Gltf, primitives

_READ = ("POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0", "_OBSCURANCE")
_WORDS = {
    "materials": "materials", "textures": "textures", "animations": "animations", "skins": "skins",
    "cameras": "cameras", "extensionsUsed": "extensions",
}  # fmt: skip


def gltf_detail(asset: Gltf, instances: Sequence[Instance], faces: np.ndarray) -> tuple[Detail, tuple[str, ...]]:
    """The first texture coordinates and colours of all vertices, and what else the file holds, in words.

    Args:
        instances: `read_instances(asset)`. faces: (m, 3), all of them, as they are placed.
    """
    header = asset.header
    pieces = [header["meshes"][piece.mesh]["primitives"][piece.place] for piece in primitives(header)]
    counts = [len(instance.vertices) for instance in instances]
    unread = [words for key, words in _WORDS.items() if header.get(key)]
    if len(instances) > 1:
        unread.insert(0, "nodes")
    pieces = [_without_ramp(header, piece) for piece in pieces]
    names = {name for piece in pieces for name in piece["attributes"]} - set(_READ)
    unread += sorted(names)
    columns = {}
    for name, kinds in (("TEXCOORD_0", ("VEC2",)), ("COLOR_0", ("VEC3", "VEC4"))):
        try:
            columns[name] = _column(asset, pieces, counts, name, kinds)
        except (MeshError, ValueError, KeyError, TypeError):
            unread.append(name)
    corners = faces.ravel()
    sizes = np.full(len(faces), 3)
    uv, colors = columns.get("TEXCOORD_0"), columns.get("COLOR_0")
    if uv is not None:
        uv = np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)
    if colors is not None:
        colors = np.concatenate([encode_srgb(colors[:, :3]).astype(np.float64), colors[:, 3:]], axis=1)
        colors = colors[:, :3] if (colors[:, 3] == 1).all() else colors
    whole = Triangulation(np.ones(len(faces), np.int64), 0, None)
    coordinates = None if uv is None else PerCorner(uv, corners)
    return Detail(corners, sizes, whole, coordinates, None, colors), tuple(unread)


def _without_ramp(header: dict[str, Any], piece: dict[str, Any]) -> dict[str, Any]:
    """A primitive without the texture coordinates of the ramp that an earlier bake has given it."""
    ramps = {f"TEXCOORD_{number}" for number in ramp_sets(header, piece)}
    return piece | {"attributes": {name: n for name, n in piece["attributes"].items() if name not in ramps}}


def _column(
    asset: Gltf, pieces: list[dict[str, Any]], counts: list[int], name: str, kinds: tuple[str, ...]
) -> Float64s | None:
    """An attribute of all vertices: of those that lack it, 0 for coordinates, and white."""
    if not any(name in piece["attributes"] for piece in pieces):
        return None
    width = int(kinds[-1][-1])
    rows = []
    for piece, count in zip(pieces, counts, strict=True):
        made = np.full((count, width), 1.0 if width == 4 else 0.0)
        if name in piece["attributes"]:
            number = piece["attributes"][name]
            accessors = asset.header["accessors"]
            kind = accessors[number]["type"] if number < len(accessors) else kinds[0]
            stored = normalized(values(asset, number, kind if kind in kinds else kinds[0]))
            if len(stored) != count or not np.isfinite(stored).all():
                raise ValueError("values that are not of the vertices")
            made[:, : stored.shape[1]] = stored
        rows.append(made)
    return np.concatenate(rows)
