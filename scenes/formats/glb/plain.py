"""Binary glTF of meshes that were no glTF: one node an object, one primitive a material of it."""

import copy
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from raytrace.errors import OptionError
from raytrace.image.srgb import decode_srgb
from raytrace.mesh.normals import creased_normals
from raytrace.mesh.up import up_axis
from raytrace.types import Float64s, Int64s

from ...geometry.detail import PerCorner, split_corners
from ..gltf.container import stand
from ..load import MeshFile
from ..ply.detail import columns_of, fractions
from ..ply.detail import stored_colors as ply_colors
from .buffer import ELEMENT_ARRAY_BUFFER, Packed
from .orm import add_materials

_LARGEST = 1e38  # of float32, and of a difference of two
WHITE: dict[str, Any] = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}}
SOURCE_INDEX = "_SOURCE_INDEX"


class Group(NamedTuple):
    """Triangles of one object and one material, which become one primitive."""

    part: int  # number of the mesh file's part
    name: str
    paint: int  # number of the material in the document
    faces: Int64s  # (t,) rows of the mesh's faces, ascending


@dataclass(frozen=True, eq=False)
class _Piece:
    """Attributes of a group's vertices."""

    vertices: Int64s  # (k,), rows of the mesh's; vertices with several normals or texture coordinates repeat
    faces: Int64s  # (t, 3) places in `vertices`
    normals: Float64s | None  # (k, 3)
    uv: Float64s | None  # (k, 2)


Drawn = tuple[dict[str, Any], Int64s]
"""A primitive of a document, and which of the baked mesh's vertices its own are."""


def plain(mesh_file: MeshFile, colors: str, up: str | None = None) -> tuple[Packed, list[Drawn]]:
    """The document, without w, and its primitives, in the order of `groups`.

    The only primitive of a part has the part's vertices in their order, then those whose corners differ once more.
    One of several has the vertices that it uses, with their rows in the mesh as `_SOURCE_INDEX`.

    A mesh without normals gets them by `raytrace.mesh.normals`.

    Where another axis than y is up, all stand below a node that turns it to y.

    Args: colors: the channels that are to hold w: of all, the source's are left out. up: in place of `Mesh.up`.
    """
    detail, mesh = mesh_file.detail, mesh_file.mesh
    header: dict[str, Any] = {"asset": {"version": "2.0", "generator": "obscurance"}, "scene": 0}
    header |= {"scenes": [{"nodes": []}], "nodes": [], "meshes": [], "materials": [copy.deepcopy(WHITE)]}
    packed = Packed(header)
    add_materials(packed, detail.paints if detail else ())
    drawn: list[Drawn] = []
    origins = [part_origin(mesh.vertices[part.vertices]) for part in mesh_file.parts]
    found = groups(mesh_file)
    before = None
    for group, piece in zip(found, _pieces(mesh_file, found), strict=True):
        origin = origins[group.part]
        if before != (group.part, group.name):
            before = group.part, group.name
            node = {"name": group.name, "mesh": packed.append("meshes", {"name": group.name, "primitives": []})}
            moved = {} if origin is None else {"translation": origin.tolist()}
            header["scenes"][0]["nodes"].append(packed.append("nodes", node | moved))
        primitive = _primitive(packed, mesh_file, piece, origin, colors)
        primitive["material"] = group.paint
        if len(found) > len(mesh_file.parts) and fits_float(piece.vertices):
            primitive["attributes"][SOURCE_INDEX] = packed.accessor(piece.vertices.astype("<f4"))
        header["meshes"][-1]["primitives"].append(primitive)
        drawn.append((primitive, piece.vertices))
    stand(header, up_axis(mesh, up), header["scenes"][0]["nodes"])
    return packed, drawn


def groups(mesh_file: MeshFile) -> list[Group]:
    """The primitives of a document of what is no glTF: part by part, object by object, materials ascending."""
    detail = mesh_file.detail
    paint = of = np.zeros(len(mesh_file.mesh.faces), np.int64)
    if detail and detail.paint_of is not None:
        paint = np.repeat(detail.paint_of + 1, detail.triangles.counts)
    if detail and detail.object_of is not None:
        of = np.repeat(detail.object_of + 1, detail.triangles.counts)
    names = ("", *(detail.objects if detail else ()))
    made = []
    for number, part in enumerate(mesh_file.parts):
        order = np.lexsort((paint[part.faces], of[part.faces])) + part.faces.start
        kinds = np.stack([of[order], paint[order]], axis=1)
        starts = np.flatnonzero((kinds[1:] != kinds[:-1]).any(axis=1)) + 1
        for faces in np.split(order, starts):
            name = names[of[faces[0]]] or part.name
            made.append(Group(number, name, int(paint[faces[0]]), faces))
    return made


def _pieces(mesh_file: MeshFile, found: list[Group]) -> Iterator[_Piece]:
    mesh, detail = mesh_file.mesh, mesh_file.detail
    corners, smooth = np.arange(mesh.faces.size).reshape(-1, 3), mesh.normals
    uv = normals = None
    if detail and (detail.uv or detail.normals):
        places = detail.triangles.take(np.arange(len(detail.corners))).ravel()
        uv, normals = (each and PerCorner(each.rows, each.of[places]) for each in (detail.uv, detail.normals))
    if smooth is None and normals is None:
        rows, of = creased_normals(mesh)
        rows[~rows.any(axis=1)] = 0, 0, 1  # of faces without area, which nothing shows
        normals = PerCorner(rows, of.ravel())
    several = [values for values in (uv, normals) if values is not None]
    alone = Counter(group.part for group in found)
    for group in found:
        start, stop = mesh_file.parts[group.part].vertices.start, mesh_file.parts[group.part].vertices.stop
        own, keep = mesh.faces.ravel() - start, stop - start if alone[group.part] == 1 else 0
        vertices, faces, first = split_corners(own, corners[group.faces], several, keep)
        yield _Piece(
            vertices + start,
            faces,
            normals.rows[normals.of[first]] if normals else None if smooth is None else smooth[vertices + start],
            uv.rows[uv.of[first]] if uv else None,
        )


def part_origin(vertices: Float64s) -> Float64s | None:
    """The origin of positions that float32 cannot hold about zero, or None. Raises: OptionError: about none it can."""
    if np.abs(vertices).max() > _LARGEST:
        raise OptionError("output", f"coordinates up to {_LARGEST:g} in a .glb", f"{np.abs(vertices).max():g}")
    if np.array_equal(vertices.astype("<f4"), vertices):
        return None
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2)


def _primitive(
    packed: Packed, mesh_file: MeshFile, piece: _Piece, origin: Float64s | None, colors: str
) -> dict[str, Any]:
    mesh, detail = mesh_file.mesh, mesh_file.detail
    places = mesh.vertices[piece.vertices] - (0 if origin is None else origin)
    stored = places.astype("<f4")
    bounds = {"min": stored.min(axis=0).tolist(), "max": stored.max(axis=0).tolist()}
    attributes = {"POSITION": packed.accessor(stored, **bounds)}
    if piece.normals is not None:
        length = np.linalg.norm(piece.normals, axis=1, keepdims=True)
        # glTF allows unit normals only: a part that lacks some goes without.
        if np.isfinite(length).all() and (length > 0).all():
            attributes["NORMAL"] = packed.accessor((piece.normals / length).astype("<f4"))
    if piece.uv is not None:
        downwards = np.stack([piece.uv[:, 0], 1 - piece.uv[:, 1]], axis=1)
        attributes["TEXCOORD_0"] = packed.accessor(downwards.astype("<f4"))
    own = detail.colors if detail and len(colors) < 2 else None
    if detail and own is None and len(colors) == 1:
        own = fractions(ply_colors(columns_of(detail.elements, "vertex")))  # the grey of an earlier bake
    if own is not None:
        own = own[piece.vertices]
        own = np.concatenate([decode_srgb(own[:, :3]), own[:, 3:]], axis=1)
        attributes["COLOR_0"] = packed.accessor(own.astype("<f4"))
    for name, values in (detail.numbers if detail else {}).items():
        if fits_float(values) and attribute_name(name) not in attributes:
            attributes[attribute_name(name)] = packed.accessor(values[piece.vertices].astype("<f4"))
    indices = packed.accessor(piece.faces.astype("<u4").ravel(), ELEMENT_ARRAY_BUFFER)
    return {"attributes": attributes, "indices": indices}


def fits_float(values: npt.NDArray[Any]) -> bool:
    """Whether float32 holds the values exactly."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(values).all() and np.array_equal(values.astype("<f4"), values))


def attribute_name(name: str) -> str:
    """The glTF name of an attribute that is not in the specification."""
    return "_" + name.upper()
