"""Texture coordinates and colours of all vertices of a glTF file, for outputs that hold nothing else of it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from raytrace.errors import MeshError
from raytrace.image.srgb import encode_srgb
from raytrace.types import Float64s, Int64s

from ...geometry.detail import Detail, PerCorner, triangle_detail
from ...geometry.instances import Submesh
from ..glb.occlusion import ramp_sets
from .accessors import column
from .asset import Gltf

_READ = ("POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0", "_OBSCURANCE")
_WORDS = {
    "materials": "materials", "textures": "textures", "animations": "animations", "skins": "skins",
    "cameras": "cameras", "extensionsUsed": "extensions",
}  # fmt: skip


def gltf_detail(asset: Gltf, parts: Sequence[Submesh], faces: Int64s) -> tuple[Detail, tuple[str, ...]]:
    """The first texture coordinates and colours of all vertices, and what else the file holds, in words.

    Args: parts: the drawn primitives. faces: (m, 3), all of them, as they are placed.
    """
    unread = [words for key, words in _WORDS.items() if asset.header.get(key)]
    if len(parts) > 1:
        unread.insert(0, "nodes")
    ramps = [{f"TEXCOORD_{n}" for n in ramp_sets(asset.header, piece.of(asset.header))} for piece in asset.drawn]
    names = [piece.primitive.attributes.keys() - own for piece, own in zip(asset.drawn, ramps, strict=True)]
    unread += sorted(set[str]().union(*names) - set(_READ))
    columns = {}
    for name, kinds, missing in (("TEXCOORD_0", ("VEC2",), 0.0), ("COLOR_0", ("VEC3", "VEC4"), 1.0)):
        lacking = [name not in own for own in names]
        try:
            columns[name] = _column(asset, parts, name, kinds, missing, lacking)
        except (MeshError, ValueError, KeyError, TypeError):
            unread.append(name)
    uv, colors = columns.get("TEXCOORD_0"), columns.get("COLOR_0")
    if colors is not None:
        colors = np.concatenate([encode_srgb(colors[:, :3]).astype(np.float64), colors[:, 3:]], axis=1)
        colors = colors[:, :3] if (colors[:, 3] == 1).all() else colors
    made = triangle_detail(faces)
    coordinates = None if uv is None else PerCorner(_upwards(uv), made.corners)
    return replace(made, uv=coordinates, colors=colors), tuple(unread)


def texture_coordinates(asset: Gltf, parts: Sequence[Submesh], faces: Int64s, number: int) -> Float64s | None:
    """The set TEXCOORD_`number` of all drawn primitives by corner (m, 3, 2), v upwards, NaN where one lacks it; None
    if all do.

    Args: parts: the primitives. faces: (m, 3).

    Raises: MeshError: values that are not finite, or not one for each vertex.
    """
    name = f"TEXCOORD_{number}"
    lacking = [name not in piece.primitive.attributes for piece in asset.drawn]
    try:
        uv = _column(asset, parts, name, ("VEC2",), np.nan, lacking)
    except (ValueError, KeyError, TypeError) as reason:
        raise MeshError(asset.path, name, "two numbers a vertex", reason) from None
    return None if uv is None else _upwards(uv)[faces]


def _upwards(uv: Float64s) -> Float64s:
    return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)


def _column(
    asset: Gltf,
    parts: Sequence[Submesh],
    name: str,
    kinds: tuple[str, ...],
    missing: float,
    lacking: Sequence[bool],
) -> Float64s | None:
    """An attribute of all vertices, `missing` of the primitives lacking it; None if all do. Raises: as `column`."""
    if all(lacking):
        return None
    made = np.full((parts[-1].vertices.stop, int(kinds[-1][-1])), missing)
    for piece, part, is_lacking in zip(asset.drawn, parts, lacking, strict=True):
        if not is_lacking:
            found = column(asset, piece.primitive, name, *kinds)
            assert found is not None
            made[part.vertices, : found.shape[1]] = found
    return made
