"""glTF 2.0 files as stored: the JSON header and the bytes of its buffers.

An own reader, beside trimesh's and pygltflib, because an output keeps all of a file that it does not change, references
stay in the file's folder, and memory is bounded: 256 times the bytes of a file + 64 MiB at most (docs/reliability.md).
Format: Khronos glTF 2.0 specification, chapter 4 (GLB container), section 3.6 (buffers).
"""

import json
import struct
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from raytrace.errors import MeshError
from raytrace.mesh.up import TO_Y_UP

from .accessors import compressions
from .asset import Gltf, referenced

_GLB_MAGIC, _JSON_CHUNK, _BIN_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
_DEEPEST = 100


def decode(data: bytes, path: Path) -> Gltf:
    """The asset in the bytes of a .gltf or .glb file.

    Raises: MeshError: not glTF 2.0, incomplete, or a buffer is missing or elsewhere. Exception: other malformed JSON.
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
    asset, read = Gltf(path, header), cache(Path.read_bytes)
    for number, stored in enumerate(asset.geometry.buffers):
        name = f"buffers[{number}]"
        if stored.uri is None and (stored.fallback or stored.khr_fallback):  # to be filled by a decoder
            raise MeshError(path, name, "uncompressed values", compressions(asset.geometry) or "none")
        content = binary if stored.uri is None else referenced(stored.uri, path.parent, read)
        if content is None:
            raise MeshError(path, name, "data in or beside the file", (stored.uri or "none")[:80])
        if len(content) < stored.byteLength:
            raise MeshError(path, name, f"{stored.byteLength} bytes", len(content))
        asset.buffers.append(content)
    return asset


def _depth(value: Any) -> int:
    """Levels of lists and objects in one another, at most one more than may be."""
    level, depth = [value] if isinstance(value, dict | list) else [], 0
    while level and depth <= _DEEPEST:
        children = (each.values() if isinstance(each, dict) else each for each in level)
        level = [child for some in children for child in some if isinstance(child, dict | list)]
        depth += 1
    return depth


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


def stand(header: dict[str, Any], up: str, roots: list[int]) -> None:
    """Put the roots of the default scene below a node that turns `up` to y, glTF's up axis, if it is another."""
    if up == "y":
        return
    matrix = np.eye(4)
    matrix[:3, :3] = TO_Y_UP[up]
    nodes = header["nodes"]
    nodes.append({"name": f"{up} up", "matrix": matrix.T.ravel().tolist(), "children": roots})
    header.setdefault("scenes", [{}])[header.setdefault("scene", 0)]["nodes"] = [len(nodes) - 1]
