"""Primitives of a glTF document given other vertices and faces: some of their own, or those of faces that are cut."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from obscurance.ao.refine import Cuts
from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.types import Int64s

from ...asset.asset import Asset
from ...asset.primitive import Array
from ...asset.refined import cut_rows, cuts_of_parts
from ..load import parser_errors
from .accessors import values
from .asset import Gltf
from .builder import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, GlbBuilder
from .write import stored_document

_VECTORS = "SCALAR", "VEC2", "VEC3", "VEC4"
_RESTART = 65535  # in indices of 16 bits, no vertex (section 3.7.2.1)
_UNIT = "NORMAL", "TANGENT"


def check_vertices(source: Asset) -> None:
    """Read all attributes of the vertices that a glTF draws, which `take_vertices` reads after a bake.

    Raises: MeshError: one is malformed, has not a row for each vertex, or a number that is not finite.
    """
    asset = source.raw
    if not isinstance(asset, Gltf):
        return
    with parser_errors(asset.path):
        for drawn in {(drawn.mesh, drawn.primitive_number): drawn for drawn in asset.drawn}.values():
            attributes = drawn.primitive.attributes
            count = asset.geometry.accessors[attributes["POSITION"]].count
            for table in (attributes, *drawn.primitive.targets):
                for name, number in table.items():
                    stored = values(asset, number, *_VECTORS)
                    field = f"meshes[{drawn.mesh}].primitives[{drawn.primitive_number}].{name}"
                    if len(stored) != count:
                        raise MeshError(asset.path, field, f"{count} rows", len(stored))
                    if stored.dtype.kind == "f" and not np.isfinite(stored).all():
                        raise MeshError(asset.path, field, "finite numbers", "others")


def draw(builder: GlbBuilder, primitive: dict[str, Any], corners: Int64s) -> None:
    """Let a primitive draw triangles with these vertices at their `corners`, of any shape."""
    kind = "<u2" if corners.max(initial=0) < _RESTART else "<u4"
    primitive["indices"] = builder.accessor(corners.ravel().astype(kind), ELEMENT_ARRAY_BUFFER)
    primitive.pop("mode", None)


def take_vertices(builder: GlbBuilder, asset: Gltf, primitive: dict[str, Any], taken_rows: Int64s) -> None:
    """Give a primitive, and its morph targets, some rows of its own vertices."""
    change_vertices(builder, asset, primitive, lambda name, stored: stored[taken_rows])


def change_vertices(
    builder: GlbBuilder, asset: Gltf, primitive: dict[str, Any], change: Callable[[str, Array], Array]
) -> None:
    """Give a primitive, and its morph targets, other rows of vertices: `change` of an attribute's name and values."""
    for attributes in (primitive["attributes"], *primitive.get("targets", [])):
        for name, accessor in attributes.items():
            stored = values(asset, accessor, *_VECTORS)
            attributes[name] = _accessor_like(builder, asset.header["accessors"][accessor], change(name, stored))


def _accessor_like(builder: GlbBuilder, old: dict[str, Any], rows: Array) -> int:
    """Index of a new accessor of `rows` (n, d), of the kind of an old one."""
    taken = np.ascontiguousarray(rows)
    data = taken.view(np.uint8)
    padding = -data.shape[1] % 4
    strided = {"byteStride": data.shape[1] + padding} if padding else {}
    view = builder.bytes_view(np.pad(data, ((0, 0), (0, padding))).tobytes(), target=ARRAY_BUFFER, **strided)
    kept = "componentType", "type", "normalized", "name", "extras"
    entry: dict[str, Any] = {key: old[key] for key in kept if key in old}
    entry |= {"bufferView": view, "count": len(taken)}
    if "min" in old:
        entry |= {"min": taken.min(axis=0).tolist(), "max": taken.max(axis=0).tolist()}
    return builder.append("accessors", entry)


def check_no_skin(source: Asset) -> None:
    """Check that faces can be cut: joints of two vertices have no mean. Raises: MeshError: a glTF has a skin."""
    if isinstance(source.raw, Gltf) and any(drawn.skin is not None for drawn in source.raw.drawn):
        raise MeshError(source.path, "skin", "none, where faces are cut between vertices", "one")


def refined_glb(source: Asset, cuts: Sequence[Cuts]) -> bytes:
    """A glTF source as stored, a mesh of its own for each instance, after cuts of the faces of its mesh."""
    raw = source.raw
    assert isinstance(raw, Gltf)
    builder, drawn = stored_document(raw, source.parts)
    stored = Gltf(source.path, builder.header, [bytes(builder.binary)])
    for (primitive, _, _), part, own in zip(drawn, source.parts, cuts_of_parts(source, cuts), strict=True):
        faces, extended = cut_rows(part.primitive.faces, len(part.primitive.positions), own)

        def change(name: str, rows: Array, extended: Callable[[Array], Array] = extended) -> Array:
            more = extended(rows)
            if name in _UNIT and more.dtype.kind == "f":
                more[:, :3] = normalize(more[:, :3])
            return more

        change_vertices(builder, stored, primitive, change)
        draw(builder, primitive, faces if part.node.volume > 0 else faces[:, ::-1])
    return builder.encode()
