"""A glTF asset: its header as records, and what its default scene draws.

Format: Khronos glTF 2.0 specification, sections 3.5 (scenes and transforms), 3.6 (buffers) and 3.7 (meshes).
"""

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeVar
from urllib.parse import unquote

import numpy as np

from raytrace.errors import MeshError
from raytrace.types import Float64s

from ...safe_paths import beside
from . import records
from .parse import parse
from .records import GltfGeometry, GltfMaterial, GltfMaterials, GltfTexture, Node, Primitive, Sampler, Stage

_PLACED = {"matrix", "translation", "rotation", "scale"}
T = TypeVar("T")


class DrawnPrimitive(NamedTuple):
    """A drawn piece of triangles."""

    node: int
    mesh: int
    place: int  # among the mesh's primitives
    primitive: Primitive
    stored: dict[str, Any]  # the same as the header has it


@dataclass(eq=False)
class Gltf:
    """A glTF asset. Records are made when they are first used: MeshError names what is malformed in them."""

    path: Path  # where it was read; relative references start beside it
    header: dict[str, Any]  # the JSON document
    buffers: list[bytes] = field(default_factory=list)  # the bytes of each of the header's buffers

    @cached_property
    def geometry(self) -> GltfGeometry:
        made = parse(GltfGeometry, self.header, self.path)
        if not made.version.startswith("2."):
            raise MeshError(self.path, "asset.version", "glTF 2.0", made.version)
        return made

    @cached_property
    def materials(self) -> GltfMaterials:
        return parse(GltfMaterials, self.header, self.path)

    @cached_property
    def stage(self) -> Stage:
        return parse(Stage, self.header, self.path)

    @property
    def files(self) -> tuple[Path, ...]:
        """The file itself, and the buffers and images beside it that it names."""
        buffers, images = self.geometry.buffers, self.geometry.images
        names = dict.fromkeys([*(each.uri or "" for each in buffers), *(each.uri for each in images)])
        found = [beside(unquote(name), self.path.parent) for name in names if not name.startswith("data:")]
        return self.path, *(path for path in found if path)

    @cached_property
    def roots(self) -> list[int]:
        """The nodes on which the default scene stands; a file without scenes shows every node that is no child."""
        geometry = self.geometry
        if "scenes" in self.header or geometry.scene:
            return entry(geometry.scenes, geometry.scene, "scenes").nodes
        children = {child for node in geometry.nodes for child in node.children}
        return [number for number in range(len(geometry.nodes)) if number not in children]

    @cached_property
    def world(self) -> dict[int, Float64s]:
        """The (4, 4) map to the world of every node that the scene shows, depth first, children in their order.

        Raises: ValueError: nodes that are no tree, or not there.
        """
        made: dict[int, Float64s] = {}
        stack = [(number, np.eye(4)) for number in reversed(self.roots)]
        while stack:
            number, parent = stack.pop()
            if number in made:
                raise ValueError(f"node {number} has two parents or is its own ancestor")
            node = entry(self.geometry.nodes, number, "nodes")
            made[number] = parent @ _local(node) if _PLACED & vars(node).keys() else parent
            stack.extend((child, made[number]) for child in reversed(node.children))
        return made

    @cached_property
    def drawn(self) -> list[DrawnPrimitive]:
        """The triangle primitives, node by node as in `world`. Raises: ValueError: as that, or a triangle fan."""
        made = []
        for node in self.world:
            mesh = self.geometry.nodes[node].mesh
            pieces = [] if mesh is None else entry(self.geometry.meshes, mesh, "meshes").primitives
            for place, primitive in enumerate(pieces):
                if primitive.mode == records.TRIANGLE_FAN:
                    raise ValueError(f"mesh {mesh} is a triangle fan, which is not supported")
                if mesh is not None and primitive.mode in (records.TRIANGLES, records.TRIANGLE_STRIP):
                    stored = self.header["meshes"][mesh]["primitives"][place]
                    made.append(DrawnPrimitive(node, mesh, place, primitive, stored))
        return made

    def material(self, primitive: Primitive) -> GltfMaterial:
        """Of a primitive, the default one if it names none. Raises: ValueError: there is no such entry."""
        number = primitive.material
        return GltfMaterial() if number is None else entry(self.materials.materials, number, "materials")

    def sampler(self, texture: GltfTexture) -> Sampler:
        """As `material`."""
        number = texture.sampler
        return Sampler() if number is None else entry(self.materials.samplers, number, "samplers")


def _local(node: Node) -> Float64s:
    if node.matrix is not None:
        return np.array(node.matrix).reshape(4, 4).T
    made = np.eye(4)
    if node.rotation is not None:
        from scipy.spatial.transform import Rotation  # loads for a fifth of a second

        made[:3, :3] = Rotation.from_quat(node.rotation).as_matrix()
    made[:3, :3] *= node.scale
    made[:3, 3] = node.translation
    return made


def entry(entries: Sequence[T], number: int, name: str) -> T:
    """One of a header's list. Raises: ValueError: there is no such entry."""
    if number >= len(entries):
        raise ValueError(f"there is no {name}[{number}]")
    return entries[number]


def referenced(uri: str, folder: Path, read: Callable[[Path], bytes] = Path.read_bytes) -> bytes | None:
    """The bytes a URI stands for: embedded base64 data, or a file inside `folder`. None for anything else."""
    try:
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition("base64,")[2])
        target = beside(unquote(uri), folder)
        return read(target) if target else None
    except (OSError, ValueError):
        return None
