"""The triangles that a glTF scene draws at rest, with the transforms of their nodes (Khronos glTF 2.0, section 3.7)."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import MeshError

from ...geometry.instances import Instance, check_copies
from ..table import MeshInput
from .accessors import normalized, triangles, values, vectors
from .asset import Gltf, decode, entry
from .draco import decompressed
from .pose import Poses, in_words
from .records import PROFILE, TRANSMISSION, Primitive

if TYPE_CHECKING:
    from obscurance.ao import Profile

_COPIES = "EXT_mesh_gpu_instancing"


def read_gltf(mesh_input: MeshInput) -> tuple[list[Instance], Gltf]:
    """The triangle primitives that a file draws, in the order of `Gltf.drawn`, sharing arrays by shape, and its asset.

    Raises: ValueError: as `decode` and `Poses`, compressed values, very many copies, nodes that are no tree, no image
        with alpha.
    """
    asset = decompressed(decode(mesh_input.file.read(), mesh_input.path))
    textures = None
    if mesh_input.alpha and _has_alpha(asset):
        from .textures import Textures, opacity_of

        textures = Textures(asset)
    poses = Poses(asset)
    shapes: dict[Any, Instance] = {}
    instances: list[Instance] = []
    copied = 0
    for drawn in asset.drawn:
        # Each shape once, posed.
        if drawn.shape not in shapes:
            shape = poses.posed(drawn, _shape(asset, drawn.primitive))
            if textures:
                shape = shape._replace(opacity=opacity_of(textures, drawn.primitive, shape.faces))
            shapes[drawn.shape] = shape
        shape = shapes[drawn.shape]
        copied += len(shape.vertices) + len(shape.faces)
        check_copies(copied, sum(map(len, asset.buffers)), asset.path)
        # Its instance: named by the node or the mesh, and placed by the node unless a skin has done so.
        node = asset.geometry.nodes[drawn.node]
        mesh = asset.geometry.meshes[drawn.mesh]
        name = node.name or mesh.name or f"node {drawn.node}"
        if len(mesh.primitives) > 1:
            name += f"[{drawn.primitive_number}]"
        notes = () if instances else in_words(asset)
        if _COPIES in node.extensions:
            notes += (f"{name} is drawn many times by {_COPIES}, which is not read: once here",)
        matrix = asset.world[drawn.node] if drawn.skin is None else shape.matrix
        instances.append(shape._replace(name=name, matrix=matrix, notes=notes))
    if textures and textures.notes:
        instances[0] = instances[0]._replace(notes=(*instances[0].notes, *textures.notes))
    return instances, asset


def _has_alpha(asset: Gltf) -> bool:
    """Whether some material may not be opaque; opaque ones are not read."""
    materials = asset.header.get("materials", [])
    tables = [table for table in materials if isinstance(table, dict)] if isinstance(materials, list) else []
    return any(
        table.get("alphaMode", "OPAQUE") != "OPAQUE" or TRANSMISSION in table.get("extensions", ()) for table in tables
    )


def _shape(asset: Gltf, primitive: Primitive) -> Instance:
    """A primitive where its own frame has it."""
    attributes = primitive.attributes
    if "POSITION" not in attributes:
        raise ValueError("a primitive without POSITION")
    vertices = vectors(asset, attributes["POSITION"])
    accessor = asset.geometry.accessors[attributes["POSITION"]]
    if accessor.bufferView is None and accessor.sparse is None:  # zeros, of which there is nothing to see
        raise MeshError(asset.path, "POSITION", "uncompressed values", "no data")
    normals = vectors(asset, attributes["NORMAL"]) if "NORMAL" in attributes else None
    faces = triangles(asset, primitive, len(vertices))
    w = _stored_w(asset, attributes, len(vertices))
    profile = _stored_profile(asset, attributes, len(vertices))
    return Instance("", vertices, faces, normals, w=w, profile=profile, up="y")


def _stored_w(asset: Gltf, attributes: dict[str, int], count: int) -> npt.NDArray[Any] | None:
    """w of an earlier bake, unless the attribute of that name is something else."""
    with suppress(KeyError, ValueError):
        w = values(asset, attributes["_OBSCURANCE"], "SCALAR").ravel()
        if len(w) == count and w.dtype.kind == "f":
            return w
    return None


def _stored_profile(asset: Gltf, attributes: dict[str, int], count: int) -> Profile | None:
    """The profile of an earlier bake, unless the attributes of these names are something else."""
    with suppress(KeyError, TypeError, ValueError):
        extras = entry(asset.geometry.accessors, attributes[f"{PROFILE}0"], "accessors").extras
        lengths = extras["half_distances"]
        numbers = [attributes[f"{PROFILE}{number}"] for number in range(-(-len(lengths) // 4))]
        columns = np.hstack([normalized(values(asset, number, "VEC4")) for number in numbers])
        if len(columns) == count:
            from obscurance.ao import Profile

            return Profile.stored(lengths, columns[:, : len(lengths)], extras["radius"], extras.get("max_distance"))
    return None
