"""Binary glTF of meshes that were no glTF: one node an object, one primitive a material of it."""

import copy
from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import OptionError
from raytrace.image.srgb import decode_srgb
from raytrace.mesh.normals import creased_normals
from raytrace.types import Float64s, Int64s

from ...geometry.detail import Detail, PerCorner, split_corners
from ..load import MeshFile
from ..ply.layout import fractions, stored_colors
from ..primitive_groups import pieces
from .accessors import flipped
from .builder import ELEMENT_ARRAY_BUFFER, Packed
from .orm import add_materials

_LARGEST = 1e38  # of float32, and of a difference of two
WHITE: dict[str, Any] = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}}
SOURCE_INDEX = "_SOURCE_INDEX"


Drawn = tuple[dict[str, Any], Int64s]
"""A primitive of a document, and which of the baked mesh's vertices its own are."""


def plain(mesh_file: MeshFile, colors: str) -> tuple[Packed, list[Drawn]]:
    """The document, without w, and its primitives, in the order of `pieces`; a mesh without normals gets some.

    The only primitive of a part has the part's vertices in their order, then those whose corners differ once more.
    One of several has the vertices that it uses, with their rows in the mesh as `_SOURCE_INDEX`.

    Args: colors: the channels that are to hold w: of all, the source's are left out.
    """
    detail, mesh, found = mesh_file.detail, mesh_file.mesh, list(pieces(mesh_file))
    header: dict[str, Any] = {"asset": {"version": "2.0", "generator": "obscurance"}, "scene": 0}
    header |= {"scenes": [{"nodes": []}], "nodes": [], "meshes": [], "materials": [copy.deepcopy(WHITE)]}
    packed = Packed(header)
    add_materials(packed, detail.paints if detail else ())
    drawn: list[Drawn] = []
    origins = [part_origin(mesh.vertices[part.vertices]) for part in mesh_file.parts]
    uv, normals = _of_corners(mesh_file)
    several = [each for each in (uv, normals) if each]
    corners, alone, before = np.arange(mesh.faces.size).reshape(-1, 3), Counter(piece.part for piece in found), None
    for piece in found:
        origin, own = origins[piece.part], mesh_file.parts[piece.part].vertices
        if before != piece.object:
            before = piece.object
            named: dict[str, Any] = {"name": before.name}
            node = named | {"mesh": packed.append("meshes", named | {"primitives": []})}
            moved = {} if origin is None else {"translation": origin.tolist()}
            header["scenes"][0]["nodes"].append(packed.append("nodes", node | moved))
        keep = own.stop - own.start if alone[piece.part] == 1 else 0
        vertices, faces, first = split_corners(mesh.faces.ravel() - own.start, corners[piece.faces], several, keep)
        vertices += own.start
        places = (mesh.vertices[vertices] - (0 if origin is None else origin)).astype("<f4")
        bounds = {"min": places.min(axis=0).tolist(), "max": places.max(axis=0).tolist()}
        attributes = {"POSITION": packed.accessor(places, **bounds)}
        smooth = None if mesh.normals is None else mesh.normals[vertices]
        _add_normals(packed, attributes, normals.rows[normals.of[first]] if normals else smooth)
        found_uv = None if uv is None else uv.rows[uv.of[first]]
        if found_uv is not None and np.isfinite(found_uv).any():
            attributes["TEXCOORD_0"] = packed.accessor(flipped(np.nan_to_num(found_uv)).astype("<f4"))
        _add_columns(packed, attributes, detail, vertices, colors)
        indices = packed.accessor(faces.astype("<u4").ravel(), ELEMENT_ARRAY_BUFFER)
        primitive = {"attributes": attributes, "indices": indices, "material": piece.material.key}
        if len(found) > len(mesh_file.parts) and fits_float(vertices):
            attributes[SOURCE_INDEX] = packed.accessor(vertices.astype("<f4"))
        header["meshes"][-1]["primitives"].append(primitive)
        drawn.append((primitive, vertices))
    return packed, drawn


def _of_corners(mesh_file: MeshFile) -> tuple[PerCorner | None, PerCorner | None]:
    """Texture coordinates and normals of the triangles' corners; no normals where each vertex has one."""
    mesh, detail = mesh_file.mesh, mesh_file.detail
    uv = normals = None
    if detail and (detail.uv or detail.normals):
        places = detail.triangles.take(np.arange(len(detail.corners))).ravel()
        uv, normals = (each and PerCorner(each.rows, each.of[places]) for each in (detail.uv, detail.normals))
    if mesh.normals is None and normals is None:
        rows, of = creased_normals(mesh)
        rows[~rows.any(axis=1)] = 0, 0, 1  # of faces without area, which nothing shows
        normals = PerCorner(rows, of.ravel())
    return uv, normals


def part_origin(vertices: Float64s) -> Float64s | None:
    """The origin of positions that float32 cannot hold about zero, or None. Raises: OptionError: about none it can."""
    if np.abs(vertices).max() > _LARGEST:
        raise OptionError("output", f"coordinates up to {_LARGEST:g} in a .glb", f"{np.abs(vertices).max():g}")
    if np.array_equal(vertices.astype("<f4"), vertices):
        return None
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2)


def _add_normals(packed: Packed, attributes: dict[str, int], normals: Float64s | None) -> None:
    """glTF allows unit normals only: a primitive that lacks some goes without."""
    if normals is not None:
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        if np.isfinite(length).all() and (length > 0).all():
            attributes["NORMAL"] = packed.accessor((normals / length).astype("<f4"))


def _add_columns(
    packed: Packed, attributes: dict[str, int], detail: Detail | None, vertices: Int64s, colors: str
) -> None:
    """Colours, unless all channels are to hold w, and further numbers of the vertices."""
    if detail is None:
        return
    own = detail.colors if len(colors) < 2 else None
    if own is None and len(colors) == 1:
        own = fractions(stored_colors(detail.elements))  # the grey of an earlier bake
    if own is not None:
        linear = np.concatenate([decode_srgb(own[vertices, :3]), own[vertices, 3:]], axis=1)
        attributes["COLOR_0"] = packed.accessor(linear.astype("<f4"))
    for name, values in detail.numbers.items():
        if fits_float(values) and attribute_name(name) not in attributes:
            attributes[attribute_name(name)] = packed.accessor(values[vertices].astype("<f4"))


def fits_float(values: npt.NDArray[Any]) -> bool:
    """Whether float32 holds the values exactly."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(values).all() and np.array_equal(values.astype("<f4"), values))


def attribute_name(name: str) -> str:
    """The glTF name of an attribute that is not in the specification."""
    return "_" + name.upper()
