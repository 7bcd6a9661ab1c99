"""A glTF document with other vertices and faces: without some of its own, or with those of faces that are cut."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from obscurance.ao.refine import Cuts
from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.types import Bools, Int64s

from ...asset.asset import Asset, Part
from ...asset.primitive import Array
from ...asset.refined import cut_rows, cuts_of_parts
from ..load import parser_errors
from .accessors import triangles, values
from .asset import Gltf
from .builder import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, GlbBuilder
from .write import one_buffer, stored_document

_VECTORS = "SCALAR", "VEC2", "VEC3", "VEC4"
_RESTART = 65535  # in indices of 16 bits, no vertex (section 3.7.2.1)
_UNIT = "NORMAL", "TANGENT"
_ZERO = {"componentType": 5121, "count": 1, "type": "SCALAR"}  # an accessor of a zero takes no bytes


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


def visible_glb(source: Asset, seen: Bools) -> tuple[bytes, int]:
    """The document without unseen faces, and how many faces it draws.

    An instance goes if all of its faces are unseen; a face that instances share, if it is unseen in all of them.
    """
    asset = source.raw
    assert isinstance(asset, Gltf)
    builder = one_buffer(asset)
    meshes = builder.header["meshes"]
    showing = _visible_nodes(asset, source.parts, seen)
    kept_faces = _visible_faces(asset, source.parts, seen)
    # Nodes of which nothing is seen draw nothing any more.
    for number in {drawn.node for drawn in asset.drawn} - showing:
        for field in ("mesh", "skin", "weights"):
            builder.header["nodes"][number].pop(field, None)
    # Each primitive with its faces that are kept, and their vertices.
    before = _values_of_primitives(meshes)
    primitives = {(drawn.mesh, drawn.primitive_number): drawn.primitive for drawn in asset.drawn}
    for (mesh, number), primitive in primitives.items():
        faces_kept = kept_faces[mesh, number]
        stored = meshes[mesh]["primitives"][number]
        if faces_kept.any():
            count = asset.geometry.accessors[primitive.attributes["POSITION"]].count
            faces = triangles(asset, primitive, count)[faces_kept]
            used, corners = np.unique(faces, return_inverse=True)
            take_vertices(builder, asset, stored, used)
            draw(builder, stored, corners)
        else:
            meshes[mesh]["primitives"][number] = None
    _drop_empty_meshes(builder.header)
    _drop_values(builder, before - _values_of_primitives(builder.header["meshes"]))
    drawn_faces = [kept_faces[drawn.mesh, drawn.primitive_number] for drawn in asset.drawn if drawn.node in showing]
    return builder.encode(), sum(int(np.count_nonzero(faces)) for faces in drawn_faces)


def _visible_nodes(asset: Gltf, parts: Sequence[Part], seen: Bools) -> set[int]:
    """The nodes that show something: seen faces, lines or points."""
    numbers = Counter(mesh for mesh, _ in {(drawn.mesh, drawn.primitive_number) for drawn in asset.drawn})
    with_lines = {mesh for mesh, count in numbers.items() if count < len(asset.geometry.meshes[mesh].primitives)}
    instances = zip(asset.drawn, parts, strict=True)
    return {drawn.node for drawn, part in instances if drawn.mesh in with_lines or seen[part.faces].any()}


def _visible_faces(asset: Gltf, parts: Sequence[Part], seen: Bools) -> dict[tuple[int, int], Bools]:
    """The faces of each mesh and primitive that are seen in some instance; all of a mesh that another scene shows,
    too."""
    drawn_nodes = {drawn.node for drawn in asset.drawn}
    elsewhere = {node.mesh for number, node in enumerate(asset.geometry.nodes) if number not in drawn_nodes}
    seen_faces: dict[tuple[int, int], Bools] = {}
    for drawn, part in zip(asset.drawn, parts, strict=True):
        primitive = drawn.mesh, drawn.primitive_number
        seen_faces[primitive] = seen[part.faces] | seen_faces.get(primitive, np.bool_(drawn.mesh in elsewhere))
    return seen_faces


def _values_of_primitives(meshes: list[dict[str, Any]]) -> set[int]:
    """The accessors of all primitives."""
    primitives = [primitive for mesh in meshes for primitive in mesh["primitives"]]
    tables = [table for primitive in primitives for table in (primitive["attributes"], *primitive.get("targets", []))]
    used = {number for table in tables for number in table.values()}
    return used | {primitive["indices"] for primitive in primitives if "indices" in primitive}


def _drop_empty_meshes(header: dict[str, Any]) -> None:
    """Take primitives that are None out of their meshes, and meshes without primitives out of the document."""
    for mesh in header["meshes"]:
        mesh["primitives"] = [primitive for primitive in mesh["primitives"] if primitive]
    drawn_meshes = [number for number, mesh in enumerate(header["meshes"]) if mesh["primitives"]]
    header["meshes"] = [header["meshes"][number] for number in drawn_meshes]
    for node in header["nodes"]:
        if "mesh" in node:
            node["mesh"] = drawn_meshes.index(node["mesh"])


def _drop_values(builder: GlbBuilder, unused: set[int]) -> None:
    """Replace accessors that are `unused`, which keep their numbers, by zeros, and drop what no view shows from the
    buffer."""
    header = builder.header
    for number in unused:
        header["accessors"][number] = dict(_ZERO)
    used = set(_buffer_views(header))
    stored = bytes(builder.binary)
    builder.binary.clear()
    for number, view in enumerate(header["bufferViews"]):
        start = view["byteOffset"]
        if number not in used:
            view["byteLength"] = 1
            view.pop("byteStride", None)
        view["byteOffset"] = builder.add(stored[start : start + view["byteLength"]])


def _buffer_views(value: Any) -> Iterator[int]:
    """Numbers of all buffer views that a document refers to."""
    if isinstance(value, dict):
        if isinstance(value.get("bufferView"), int):
            yield value["bufferView"]
        value = value.values()
    elif not isinstance(value, list):
        return
    for child in value:
        yield from _buffer_views(child)
