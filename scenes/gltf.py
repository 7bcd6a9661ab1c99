"""glTF 2.0 files as they are stored: the JSON header and the bytes of its buffers.

Format: Khronos glTF 2.0 specification, chapter 4 (GLB container), section 3.6 (buffers), 3.7 (meshes).
"""

from __future__ import annotations

import base64
import io
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError

from .flatten import Instance, world_matrices

_GLB_MAGIC, _JSON_CHUNK, _BIN_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN = 4, 5, 6


@dataclass(frozen=True)
class Gltf:
    """A glTF asset.

    Attributes:
        header: the JSON document.
        buffers: the bytes of each entry of `header["buffers"]`.
        folder: where its relative references start.
    """

    header: dict[str, Any]
    buffers: tuple[bytes, ...]
    folder: Path


class Primitive(NamedTuple):
    """A drawn piece of triangles: indices of its node and mesh, and its place among the mesh's primitives."""

    node: int
    mesh: int
    place: int


def decode(data: bytes, path: Path) -> Gltf:
    """The asset in the bytes of a .gltf or .glb file.

    Raises:
        MeshError: not glTF 2.0, incomplete, or a buffer is missing or outside the file's folder.
        Exception: other malformed JSON.
    """
    binary = None
    if data[:4] == b"glTF":
        data, binary = _chunks(data, path)
    header = json.loads(data.decode("utf-8"))
    if not isinstance(header, dict) or not str(header.get("asset", {}).get("version", "")).startswith("2."):
        raise MeshError(path, "asset.version", "glTF 2.0", "another version or none")
    for key in ("scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers", "images"):
        entries = header.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise MeshError(path, key, "a list of objects", "something else")
    buffers = []
    for index, buffer in enumerate(header.get("buffers", [])):
        content = binary if "uri" not in buffer else reference(buffer["uri"], path.parent)
        if content is None:
            raise MeshError(path, f"buffers[{index}]", "data in or beside the file", buffer.get("uri", "none")[:80])
        if len(content) < buffer["byteLength"]:
            raise MeshError(path, f"buffers[{index}]", f"{buffer['byteLength']} bytes", len(content))
        buffers.append(content)
    return Gltf(header, tuple(buffers), path.parent)


def reference(uri: str, folder: Path) -> bytes | None:
    """The bytes a URI stands for: embedded base64 data, or a file inside `folder`. None for anything else."""
    try:
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition("base64,")[2])
        root = folder.resolve()
        target = (root / unquote(uri)).resolve()
        return target.read_bytes() if target.is_relative_to(root) and target.is_file() else None
    except (OSError, ValueError):
        return None


def _chunks(data: bytes, path: Path) -> tuple[bytes, bytes | None]:
    """The JSON chunk and the binary chunk of a GLB container."""
    _magic, version, length = struct.unpack_from("<III", data)
    if version != 2:
        raise MeshError(path, "version", "glTF 2", version)
    if length > len(data):
        raise MeshError(path, "length", f"{length} bytes as its header says", len(data))
    chunks: dict[int, bytes] = {}
    start = 12
    while start + 8 <= length:
        size, kind = struct.unpack_from("<II", data, start)
        chunks.setdefault(kind, data[start + 8 : min(start + 8 + size, length)])
        start += 8 + size
    if _JSON_CHUNK not in chunks:
        raise MeshError(path, "content", "a JSON chunk", "none")
    return chunks[_JSON_CHUNK], chunks.get(_BIN_CHUNK)


def encode_glb(header: dict[str, Any], binary: bytes) -> bytes:
    """A GLB file. The header should declare one buffer, without URI, of `len(binary)` bytes."""
    content = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode("utf-8")
    content += b" " * (-len(content) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<II", len(content), _JSON_CHUNK) + content
    chunks += struct.pack("<II", len(binary), _BIN_CHUNK) + binary
    return struct.pack("<III", _GLB_MAGIC, 2, 12 + len(chunks)) + chunks


def primitives(header: dict[str, Any]) -> Iterator[Primitive]:
    """The triangle primitives the default scene draws, depth first, children in their order.

    A file without scenes shows every node that is no child.

    Raises:
        ValueError: the nodes are no tree, or a primitive is a triangle fan, which trimesh does not read.
    """
    nodes = header.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    scenes = header.get("scenes", [{"nodes": [n for n in range(len(nodes)) if n not in children]}])
    stack = list(reversed(scenes[header.get("scene", 0)].get("nodes", [])))
    seen: set[int] = set()
    while stack:
        number = stack.pop()
        if number in seen or number < 0:
            raise ValueError(f"node {number} has two parents or is its own ancestor")
        seen.add(number)
        node = nodes[number]
        stack.extend(reversed(node.get("children", [])))
        if "mesh" not in node:
            continue
        for place, primitive in enumerate(header["meshes"][node["mesh"]]["primitives"]):
            mode = primitive.get("mode", _TRIANGLES)
            if mode == _TRIANGLE_FAN:
                raise ValueError(f"mesh {node['mesh']} is a triangle fan, which is not supported")
            if mode in (_TRIANGLES, _TRIANGLE_STRIP):
                yield Primitive(number, node["mesh"], place)


def read_instances(asset: Gltf, source: str) -> list[Instance]:
    """The drawn triangle primitives, in the order of `primitives`.

    Raises:
        MeshError: sparse or compressed positions or indices, which are not supported.
        Exception: whatever trimesh raises on a malformed file.
    """
    from trimesh.exchange.load import mesh_loaders

    drawn = list(primitives(asset.header))
    if not drawn:
        return []
    plain = _plain_header(asset, drawn, source)
    loaded = mesh_loaders["gltf"](
        file_obj=io.BytesIO(json.dumps(plain).encode()),
        resolver={str(number): memoryview(buffer) for number, buffer in enumerate(asset.buffers)},
        skip_materials=True,
    )
    world = world_matrices(loaded["graph"], loaded["base_frame"])
    return [_instance(piece, asset.header, loaded["geometry"], world[str(piece.node)]) for piece in drawn]


def _plain_header(asset: Gltf, drawn: list[Primitive], source: str) -> dict[str, Any]:
    """Only what geometry needs, with nodes named by their number and one primitive a mesh.

    So trimesh's answers can be told apart whatever the file's own names are, and nothing else of it can fail.
    """
    header = asset.header
    kinds = list(dict.fromkeys((piece.mesh, piece.place) for piece in drawn))
    used: set[int] = set()
    meshes = []
    for mesh, place in kinds:
        primitive = header["meshes"][mesh]["primitives"][place]
        kept = {name: n for name, n in primitive["attributes"].items() if name in ("POSITION", "NORMAL")}
        plain = {"attributes": kept} | {key: primitive[key] for key in ("indices", "mode") if key in primitive}
        used.update(kept.values(), [plain["indices"]] if "indices" in plain else [])
        meshes.append({"name": f"{mesh}/{place}", "primitives": [plain]})
    unread = {"componentType": 5126, "count": 0, "type": "SCALAR"}
    accessors = [a if n in used else unread for n, a in enumerate(header["accessors"])]
    for number in used:
        _check_stored(header, number, source)
    nodes = [
        {"name": str(number)}
        | {key: node[key] for key in ("children", "matrix", "translation", "rotation", "scale") if key in node}
        for number, node in enumerate(header["nodes"])
    ]
    nested = {child for node in nodes for child in node.get("children", [])}
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [n for n in range(len(nodes)) if n not in nested]}],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": header["bufferViews"],
        "buffers": [{"uri": str(number)} for number in range(len(asset.buffers))],
    }


def _instance(
    piece: Primitive, header: dict[str, Any], geometry: dict[str, Any], matrix: npt.NDArray[np.float64]
) -> Instance:
    arrays = geometry[f"{piece.mesh}/{piece.place}"]
    mesh = header["meshes"][piece.mesh]
    name = header["nodes"][piece.node].get("name") or mesh.get("name") or f"node {piece.node}"
    if len(mesh["primitives"]) > 1:
        name = f"{name}[{piece.place}]"
    position = header["accessors"][mesh["primitives"][piece.place]["attributes"]["POSITION"]]
    vertices = arrays["vertices"]
    if position.get("normalized"):
        # glTF 2.0, section 3.11: c / (2^(bits-1) - 1), not below -1, for signed; c / (2^bits - 1) for unsigned.
        vertices = np.maximum(vertices / np.iinfo(vertices.dtype).max, -1.0)
    return Instance(name, vertices, arrays["faces"], arrays.get("vertex_normals"), matrix)


def _check_stored(header: dict[str, Any], number: int, source: str) -> None:
    """Refuse what trimesh would read as something else."""
    accessor = header["accessors"][number]
    if accessor["count"] < 1:
        raise MeshError(source, f"accessors[{number}]", "a count of at least 1", accessor["count"])
    view = header["bufferViews"][accessor["bufferView"]] if "bufferView" in accessor else None
    if "sparse" in accessor:
        raise MeshError(source, f"accessors[{number}]", "plain values", "a sparse accessor, which is not supported")
    if view is None or "EXT_meshopt_compression" in view.get("extensions", {}):
        required = ", ".join(header.get("extensionsUsed", [])) or "no data"
        raise MeshError(source, f"accessors[{number}]", "uncompressed values", required)
