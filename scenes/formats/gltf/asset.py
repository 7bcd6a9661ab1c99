"""A glTF asset: its JSON header as records, the bytes of its buffers, and what its default scene draws.

An own reader, beside trimesh's and pygltflib, because an output keeps all of a file that it does not change, references
stay in the file's folder, and memory is bounded: 256 times the bytes of a file + 64 MiB (evidence/reliability.md).
Format: Khronos glTF 2.0 specification, sections 3.5 (scenes), 3.6 (buffers) and 3.7 (meshes), chapter 4 (GLB).
"""

import base64
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.types import Float64s

from ...asset.asset import Stored
from ...geometry.instances import rotation_of_quaternion
from ...json_toml import parse_json, shown
from ...safe_paths import resolve_uri
from .records import (
    TRIANGLE_MODES,
    GltfAsset,
    GltfGeometry,
    GltfMaterials,
    GltfTexture,
    Node,
    Primitive,
    Sampler,
    parse,
)

_PLACED = {"matrix", "translation", "rotation", "scale"}
JSON_CHUNK, BIN_CHUNK = 0x4E4F534A, 0x004E4942
_DEEPEST = 100
DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
RECORD = "obscurance"  # among the extras of `asset`: how w was baked
T = TypeVar("T")


class DrawnPrimitive(NamedTuple):
    """A drawn primitive of triangles."""

    node: int
    mesh: int
    primitive_number: int  # among the mesh's primitives
    primitive: Primitive
    stored: dict[str, Any]  # the same as the header has it
    skin: int | None
    weights: tuple[float, ...]  # of the morph targets; none: all 0

    @property
    def shape(self) -> tuple[int, int, int | None, tuple[float, ...]]:
        """A key that is equal for primitives of one shape."""
        return self.mesh, self.primitive_number, self.skin, self.weights


@dataclass(eq=False)
class Gltf(Stored):
    """A glTF asset. Records are made when they are first used: MeshError names what is malformed in them."""

    is_scene = True
    path: Path  # where it was read; relative references start beside it
    header: dict[str, Any]  # the JSON document
    buffers: list[bytes] = field(default_factory=list)  # the bytes of each of the header's buffers

    @cached_property
    def geometry(self) -> GltfGeometry:
        """Meshes, nodes and accessors of the header. Raises: MeshError."""
        version = parse(GltfAsset, self.header, self.path).version
        if not str(version).startswith("2."):
            raise MeshError(self.path, "asset.version", "glTF 2.0", shown(version))
        return parse(GltfGeometry, self.header, self.path)

    @cached_property
    def materials(self) -> GltfMaterials:
        """Materials, textures and samplers of the header. Raises: MeshError."""
        return parse(GltfMaterials, self.header, self.path)

    @property
    def record(self) -> str:  # type: ignore[override]
        """The record of the bake whose w it holds, as `describe_bake` writes it."""
        extras = self.header.get("asset", {}).get("extras")
        return str(extras.get(RECORD, "")) if isinstance(extras, dict) else ""

    @property
    def files(self) -> tuple[Path, ...]:
        """The buffers and images beside it that it names."""
        buffers = self.geometry.buffers
        images = self.geometry.images
        names = dict.fromkeys([*(stored.uri or "" for stored in buffers), *(stored.uri for stored in images)])
        paths = [resolve_uri(name, self.path.parent) for name in names if not name.startswith("data:")]
        return tuple(path for path in paths if path)

    @cached_property
    def _read(self) -> Callable[[Path], bytes]:
        return cache(Path.read_bytes)

    def referenced(self, uri: str) -> bytes | None:
        """The bytes a URI stands for: embedded base64 data, or a file beside the asset or below. None for others."""
        try:
            if uri.startswith("data:"):
                return base64.b64decode(uri.partition("base64,")[2])
            target = resolve_uri(uri, self.path.parent)
            return self._read(target) if target else None
        except (OSError, ValueError):
            return None

    @property
    def compressions(self) -> str:
        """The compressions that a file says it uses, for messages; empty if none."""
        used = {*self.geometry.extensionsUsed, *self.geometry.extensionsRequired}
        names = ", ".join(name for name in (DRACO, *MESHOPT) if name in used)
        return names and f"{names}, which is not decoded"

    @cached_property
    def roots(self) -> list[int]:
        """The nodes on which the default scene stands; a file without scenes shows every node that is no child."""
        geometry = self.geometry
        if "scenes" in self.header or geometry.scene:
            return entry(geometry.scenes, geometry.scene, "scenes").nodes
        return self._tops

    @cached_property
    def _tops(self) -> list[int]:
        """The nodes that are no child of another."""
        children = {child for node in self.geometry.nodes for child in node.children}
        return [number for number in range(len(self.geometry.nodes)) if number not in children]

    @cached_property
    def world(self) -> dict[int, Float64s]:
        """The (4, 4) map to the world of every node that the scene shows, depth first, children in their order.

        Raises: ValueError: nodes that are no tree, or not there.
        """
        return self._placed(self.roots)

    @cached_property
    def hidden(self) -> list[int]:
        """The nodes on which the trees of joints stand that the scene does not show though it shows their skins."""
        numbers = {drawn.skin for drawn in self.drawn if drawn.skin is not None}
        skins = [entry(self.geometry.skins, number, "skins") for number in numbers]
        if all(joint in self.world for skin in skins for joint in skin.joints):
            return []
        return [number for number in self._tops if number not in self.world]

    @cached_property
    def everywhere(self) -> dict[int, Float64s]:
        """The maps of `world` and those of `hidden` trees. Raises: ValueError: as `world`, or there is no such skin."""
        return self._placed(self.hidden) | self.world

    def _placed(self, roots: list[int]) -> dict[int, Float64s]:
        """The (4, 4) map to the world of `roots` and all nodes below. Raises: ValueError: they are no trees."""
        world: dict[int, Float64s] = {}
        stack = [(number, np.eye(4)) for number in reversed(roots)]
        while stack:
            number, parent = stack.pop()
            if number in world:
                raise ValueError(f"node {number} has two parents or is its own ancestor")
            node = entry(self.geometry.nodes, number, "nodes")
            world[number] = parent @ _local(node) if _PLACED & vars(node).keys() else parent
            stack.extend((child, world[number]) for child in reversed(node.children))
        return world

    @cached_property
    def drawn(self) -> list[DrawnPrimitive]:
        """The primitives of triangles, node by node as in `world`. Raises: ValueError: as that."""
        drawn = []
        for number in self.world:
            node = self.geometry.nodes[number]
            mesh = node.mesh
            if mesh is None:
                continue
            stored_mesh = entry(self.geometry.meshes, mesh, "meshes")
            weights = tuple(node.weights or stored_mesh.weights)
            for number_in_mesh, primitive in enumerate(stored_mesh.primitives):
                if primitive.mode in TRIANGLE_MODES:
                    stored = self.header["meshes"][mesh]["primitives"][number_in_mesh]
                    drawn.append(DrawnPrimitive(number, mesh, number_in_mesh, primitive, stored, node.skin, weights))
        return drawn

    def sampler(self, texture: GltfTexture) -> Sampler:
        """The sampler of a texture, the default one if it names none. Raises: ValueError: there is no such entry."""
        number = texture.sampler
        return Sampler() if number is None else entry(self.materials.samplers, number, "samplers")


def _local(node: Node) -> Float64s:
    """The (4, 4) map from a node to its parent."""
    if node.matrix is not None:
        return np.array(node.matrix).reshape(4, 4).T
    matrix = np.eye(4)
    if node.rotation is not None:
        matrix[:3, :3] = rotation_of_quaternion(node.rotation)
    matrix[:3, :3] *= node.scale
    matrix[:3, 3] = node.translation
    return matrix


def entry(entries: Sequence[T], number: int, name: str) -> T:
    """The entry of a list of the header, `name`, by its number. Raises: ValueError: there is none."""
    if number >= len(entries):
        raise ValueError(f"there is no {name}[{number}]")
    return entries[number]


def decode(data: bytes, path: Path) -> Gltf:
    """The asset in a file's bytes. Raises: MeshError: not glTF 2.0, incomplete, or a buffer is missing or elsewhere."""
    binary = None
    if data[:4] == b"glTF":
        data, binary = _chunks(data, path)
    try:
        header = parse_json(data.decode("utf-8"))
        deep = isinstance(header, dict | list) and _depth(header) > _DEEPEST
    except RecursionError:
        deep = True
    if deep:
        raise MeshError(path, "content", f"JSON of at most {_DEEPEST} levels", "more")
    asset = Gltf(path, header)
    for number, stored in enumerate(asset.geometry.buffers):
        name = f"buffers[{number}]"
        if stored.uri is None and (stored.fallback or stored.khr_fallback):  # to be filled by a decoder
            raise MeshError(path, name, "uncompressed values", asset.compressions or "none")
        content = binary if stored.uri is None else asset.referenced(stored.uri)
        if content is None:
            raise MeshError(path, name, "data in or beside the file", (stored.uri or "none")[:80])
        if len(content) < stored.byteLength:
            raise MeshError(path, name, f"{stored.byteLength} bytes", len(content))
        asset.buffers.append(content)
    return asset


def _depth(value: dict[str, Any] | list[Any]) -> int:
    """Levels of lists and objects in one another. Raises: RecursionError: very many."""
    children = value.values() if isinstance(value, dict) else value
    return 1 + max((_depth(child) for child in children if isinstance(child, dict | list)), default=0)


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
    if JSON_CHUNK not in chunks:
        raise MeshError(path, "content", "a JSON chunk", "none")
    return chunks[JSON_CHUNK], chunks.get(BIN_CHUNK)
