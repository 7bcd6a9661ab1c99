"""Binary glTF of meshes that were no glTF: one node a part, one primitive a material."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import OptionError
from raytrace.image.srgb import decode_srgb
from raytrace.mesh.normals import vertex_normals
from raytrace.types import Float64s, Int64s

from ..geometry.detail import Detail, Paint, split_corners
from ..geometry.instances import Part
from ..gltf.glb_buffer import ELEMENT_ARRAY_BUFFER, FLOAT, UNSIGNED_INT, Packed
from ..gltf.pictures import base_colour_picture
from ..readers.load import MeshFile

_LARGEST = 1e38  # of float32, and of a difference of two
WHITE: dict[str, Any] = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}}


@dataclass(frozen=True, eq=False)
class _Piece:
    """Triangles of one material.

    Attributes:
        vertices: (k,) which vertices of the mesh these are; those with several normals or texture coordinates repeat.
        faces: (m, 3) places in `vertices`.
        normals, uv: (k, 3) and (k, 2), or None.
        paint: number of the material in the document.
    """

    vertices: Int64s
    faces: Int64s
    normals: Float64s | None
    uv: Float64s | None
    paint: int


Drawn = tuple[dict[str, Any], Int64s | slice]
"""A primitive of a document, and which of the baked mesh's vertices its own are."""


def plain(mesh_file: MeshFile, colors: bool) -> tuple[Packed, list[Drawn]]:
    """The document, without w, and its primitives. A vertex whose corners differ is stored several times.

    Where there is one material, the first vertices are the file's in its order, and repeated ones come after them.

    Args: colors: leave the source's colours out.
    """
    detail = mesh_file.detail
    packed = Packed(
        {
            "asset": {"version": "2.0", "generator": "obscurance"},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(mesh_file.parts)))}],
            "nodes": [],
            "meshes": [],
            "materials": [copy.deepcopy(WHITE), *_materials(detail)],
        }
    )
    _textures(packed, detail)
    drawn: list[Drawn] = []
    for number, part in enumerate(mesh_file.parts):
        node: dict[str, Any] = {"name": part.name, "mesh": number}
        origin = _origin(mesh_file.mesh.vertices[part.vertices])
        if origin is not None:
            node["translation"] = origin.tolist()
        pieces = _cut(mesh_file, detail) if detail else [_whole(mesh_file, part)]
        made = [(_primitive(packed, mesh_file, piece, origin, colors), piece.vertices) for piece in pieces]
        packed.header["nodes"].append(node)
        packed.header["meshes"].append({"name": part.name, "primitives": [primitive for primitive, _ in made]})
        drawn += made
    return packed, drawn


def _whole(mesh_file: MeshFile, part: Part) -> _Piece:
    mesh = mesh_file.mesh
    normals = None if mesh.normals is None else mesh.normals[part.vertices]
    faces = mesh.faces[part.faces] - part.vertices.start
    return _Piece(np.arange(part.vertices.start, part.vertices.stop), faces, normals, None, 0)


def _cut(mesh_file: MeshFile, detail: Detail) -> list[_Piece]:
    """The mesh by materials."""
    mesh = mesh_file.mesh
    places = detail.triangles.take(np.arange(len(detail.corners)))
    paint = np.zeros(len(mesh.faces), np.int64)
    if detail.paint_of is not None:
        paint = np.repeat(detail.paint_of + 1, detail.triangles.counts)
    several = [values for values in (detail.uv, detail.normals) if values is not None]
    pieces = []
    used = np.unique(paint)
    smooth = mesh.normals
    if smooth is None and detail.normals is None:
        corners = None if detail.uv is None else detail.uv.at_vertices(detail.corners, len(mesh.vertices))
        if len(used) > 1 or (detail.uv is not None and corners is None):  # seams must not turn into hard edges
            smooth = vertex_normals(mesh.vertices, mesh.faces)
    for number in used:
        own = places[paint == number] if len(used) > 1 else places
        vertices, faces, first = split_corners(
            detail.corners, own, several, len(mesh.vertices) if len(used) == 1 else 0
        )
        rows = {id(values): values.rows[values.of[first]] for values in several}
        normals = rows.get(id(detail.normals), None if smooth is None else smooth[vertices])
        pieces.append(_Piece(vertices, faces, normals, rows.get(id(detail.uv)), int(number)))
    return pieces


def _origin(vertices: Float64s) -> Float64s | None:
    """The origin of positions that float32 cannot hold about zero, or None."""
    if np.abs(vertices).max() > _LARGEST:
        raise OptionError("output", f"coordinates up to {_LARGEST:g} in a .glb", f"{np.abs(vertices).max():g}")
    if np.array_equal(vertices.astype("<f4"), vertices):
        return None
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2)


def _primitive(
    packed: Packed,
    mesh_file: MeshFile,
    piece: _Piece,
    origin: Float64s | None,
    colors: bool,
) -> dict[str, Any]:
    mesh, detail = mesh_file.mesh, mesh_file.detail
    places = mesh.vertices[piece.vertices] - (0 if origin is None else origin)
    stored = places.astype("<f4")
    bounds = {"min": stored.min(axis=0).tolist(), "max": stored.max(axis=0).tolist()}
    attributes = {"POSITION": packed.accessor(stored, FLOAT, "VEC3", **bounds)}
    if piece.normals is not None:
        length = np.linalg.norm(piece.normals, axis=1, keepdims=True)
        # glTF allows unit normals only: a part that lacks some goes without.
        if np.isfinite(length).all() and (length > 0).all():
            attributes["NORMAL"] = packed.accessor((piece.normals / length).astype("<f4"), FLOAT, "VEC3")
    if piece.uv is not None:
        downwards = np.stack([piece.uv[:, 0], 1 - piece.uv[:, 1]], axis=1).astype("<f4")
        attributes["TEXCOORD_0"] = packed.accessor(downwards, FLOAT, "VEC2")
    if detail and detail.colors is not None and not colors:
        own = detail.colors[piece.vertices]
        own = np.concatenate([decode_srgb(own[:, :3]), own[:, 3:]], axis=1).astype("<f4")
        attributes["COLOR_0"] = packed.accessor(own, FLOAT, f"VEC{own.shape[1]}")
    for name, values in (detail.numbers if detail else {}).items():
        if fits_float(values) and attribute_name(name) not in attributes:
            attributes[attribute_name(name)] = packed.accessor(values[piece.vertices].astype("<f4"), FLOAT, "SCALAR")
    faces = piece.faces.astype("<u4").ravel()
    indices = packed.accessor(faces, UNSIGNED_INT, "SCALAR", ELEMENT_ARRAY_BUFFER)
    return {"attributes": attributes, "indices": indices, "material": piece.paint}


def fits_float(values: npt.NDArray[Any]) -> bool:
    """Whether float32 holds the values exactly."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(values).all() and np.array_equal(values.astype("<f4"), values))


def attribute_name(name: str) -> str:
    """What glTF calls an attribute of one's own."""
    return "_" + name.upper()


def _materials(detail: Detail | None) -> list[dict[str, Any]]:
    return [_material(paint) for paint in detail.paints] if detail else []


def _material(paint: Paint) -> dict[str, Any]:
    surface: dict[str, Any] = {
        "baseColorFactor": [*paint.colour, paint.opacity],
        "metallicFactor": paint.metallic,
        "roughnessFactor": paint.roughness,
    }
    made: dict[str, Any] = {"name": paint.name, "pbrMetallicRoughness": surface}
    if any(paint.emission):
        made["emissiveFactor"] = list(paint.emission)
    if paint.opacity < 1 or paint.opacity_texture:
        made["alphaMode"] = "BLEND"
    return made


def _textures(packed: Packed, detail: Detail | None) -> None:
    """Put pictures into the buffer, each once, and point the materials to them."""
    header = packed.header
    numbers: dict[Any, int] = {}
    for number, paint in enumerate(detail.paints if detail else (), start=1):
        key, first = (paint.texture, paint.opacity_texture), paint.texture or paint.opacity_texture
        if first is None:
            continue
        if key not in numbers:
            data = base_colour_picture(paint)
            kind = "image/png" if data.startswith(b"\x89PNG") else "image/jpeg"
            image = {"name": first.name, "mimeType": kind, "bufferView": packed.bytes_view(data)}
            header.setdefault("images", []).append(image)
            header.setdefault("textures", []).append({"source": len(header["images"]) - 1})
            numbers[key] = len(header["textures"]) - 1
        texture = {"index": numbers[key]}
        header["materials"][number]["pbrMetallicRoughness"]["baseColorTexture"] = texture
