"""glTF 2.0 files as stored: the JSON header and the bytes of its buffers.

An own reader because an output keeps all of the file that it does not change, references must stay in the file's
folder, and memory is bounded: 256 times the bytes of a file + 64 MiB at most (docs/reliability.md).
Format: Khronos glTF 2.0 specification, chapter 4 (GLB container), section 3.6 (buffers), 3.7 (meshes).
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

from raytrace.errors import MeshError

from .compression import compressions, is_placeholder
from .schema import check_geometry

_GLB_MAGIC, _JSON_CHUNK, _BIN_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
_DEEPEST = 100
TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN = 4, 5, 6


@dataclass(frozen=True)
class Gltf:
    """A glTF asset.

    Attributes:
        path: where it was read; relative references start beside it.
        header: the JSON document.
        buffers: the bytes of each entry of `header["buffers"]`.
    """

    path: Path
    header: dict[str, Any]
    buffers: tuple[bytes, ...]

    @property
    def files(self) -> tuple[Path, ...]:
        """The file itself and those beside it that it names, buffers and images."""
        entries = [*self.header.get("buffers", []), *self.header.get("images", [])]
        names = [str(entry.get("uri", "data:")) for entry in entries]
        beside = [_beside(name, self.path.parent) for name in dict.fromkeys(names) if not name.startswith("data:")]
        return self.path, *(path for path in beside if path)


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
    try:
        header = json.loads(data.decode("utf-8"))
        deep = _depth(header) > _DEEPEST
    except RecursionError:
        deep = True
    if deep:
        raise MeshError(path, "content", f"JSON of at most {_DEEPEST} levels", "more")
    check_geometry(header, path)
    buffers = []
    read = cache(Path.read_bytes)
    for index, buffer in enumerate(header.get("buffers", [])):
        if is_placeholder(buffer):
            raise MeshError(path, f"buffers[{index}]", "uncompressed values", compressions(header) or "none")
        content = binary if "uri" not in buffer else referenced(buffer["uri"], path.parent, read)
        if content is None:
            raise MeshError(path, f"buffers[{index}]", "data in or beside the file", buffer.get("uri", "none")[:80])
        if len(content) < buffer["byteLength"]:
            raise MeshError(path, f"buffers[{index}]", f"{buffer['byteLength']} bytes", len(content))
        buffers.append(content)
    return Gltf(path, header, tuple(buffers))


def _depth(value: Any) -> int:
    """Levels of lists and objects in one another, at most one more than may be."""
    level, depth = [value] if isinstance(value, dict | list) else [], 0
    while level and depth <= _DEEPEST:
        children = (each.values() if isinstance(each, dict) else each for each in level)
        level = [child for some in children for child in some if isinstance(child, dict | list)]
        depth += 1
    return depth


def referenced(uri: str, folder: Path, read: Callable[[Path], bytes] = Path.read_bytes) -> bytes | None:
    """The bytes a URI stands for: embedded base64 data, or a file inside `folder`. None for anything else.

    Args: read: given once to several calls, it may keep what it has read.
    """
    try:
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition("base64,")[2])
        target = _beside(uri, folder)
        return read(target) if target else None
    except (OSError, ValueError):
        return None


def _beside(uri: str, folder: Path) -> Path | None:
    """The existing file inside `folder` that a relative URI names, or None."""
    try:
        root = folder.resolve()
        target = (root / unquote(uri)).resolve()
        return target if target.is_relative_to(root) and target.is_file() else None
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
    content = json.dumps(header, separators=(",", ":")).encode("ascii")
    content += b" " * (-len(content) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<II", len(content), _JSON_CHUNK) + content
    chunks += struct.pack("<II", len(binary), _BIN_CHUNK) + binary
    return struct.pack("<III", _GLB_MAGIC, 2, 12 + len(chunks)) + chunks


def roots(header: dict[str, Any]) -> list[int]:
    """The nodes on which the default scene stands; a file without scenes shows every node that is no child."""
    nodes = header.get("nodes", [])
    children = {child for node in nodes for child in node.get("children", [])}
    scenes = header.get("scenes", [{"nodes": [n for n in range(len(nodes)) if n not in children]}])
    shown = header.get("scene", 0)
    if shown >= len(scenes):
        raise ValueError(f"there is no scenes[{shown}]")
    return list(scenes[shown].get("nodes", []))


def primitives(header: dict[str, Any]) -> Iterator[Primitive]:
    """The triangle primitives the default scene draws, depth first, children in their order.

    Raises:
        ValueError: the nodes are no tree, indices of what is not there, or a triangle fan, which is not supported.
    """
    nodes, meshes = header.get("nodes", []), header.get("meshes", [])
    stack = list(reversed(roots(header)))
    seen: set[int] = set()
    while stack:
        number = stack.pop()
        if number in seen:
            raise ValueError(f"node {number} has two parents or is its own ancestor")
        if number >= len(nodes):
            raise ValueError(f"there is no nodes[{number}]")
        seen.add(number)
        node = nodes[number]
        stack.extend(reversed(node.get("children", [])))
        if "mesh" not in node:
            continue
        if node["mesh"] >= len(meshes):
            raise ValueError(f"there is no meshes[{node['mesh']}]")
        for place, primitive in enumerate(meshes[node["mesh"]]["primitives"]):
            mode = primitive.get("mode", TRIANGLES)
            if mode == TRIANGLE_FAN:
                raise ValueError(f"mesh {node['mesh']} is a triangle fan, which is not supported")
            if mode in (TRIANGLES, TRIANGLE_STRIP):
                yield Primitive(number, node["mesh"], place)
