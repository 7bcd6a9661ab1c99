"""The triangles that a glTF scene draws at rest, with the transforms of their nodes (Khronos glTF 2.0, section 3.7)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from raytrace import Opacity
from raytrace.errors import MeshError
from raytrace.types import Int64s

from ...geometry.instances import Instance, check_copies
from ..table import MeshInput
from .accessors import normalized, triangles, values, vectors
from .asset import DrawnPrimitive, Gltf, decode, entry
from .pose import Poses, in_words
from .records import PROFILE, Primitive

if TYPE_CHECKING:
    from ao import Profile

_COPIES = "EXT_mesh_gpu_instancing"


def read_gltf(given: MeshInput) -> tuple[list[Instance], Gltf]:
    """The triangle primitives that a file draws, in the order of `Gltf.drawn`, sharing arrays by shape, and its asset.

    Raises: ValueError: as `decode` and `Poses`, compressed values, very many copies, nodes that are no tree, no image
        with alpha.
    """
    asset = decode(given.file.read(), given.path)
    opacity_of = _opacity_reader(asset) if given.alpha else None
    poses = Poses(asset)
    shapes: dict[Any, Instance] = {}
    made: list[Instance] = []
    copied = 0
    for drawn in asset.drawn:
        if drawn.shape not in shapes:
            shape = poses.posed(drawn, _shape(asset, drawn.primitive))
            shape = shape._replace(opacity=opacity_of(drawn.primitive, shape.faces)) if opacity_of else shape
            shapes[drawn.shape] = shape
        shape = shapes[drawn.shape]
        copied += len(shape.vertices) + len(shape.faces)
        check_copies(copied, sum(map(len, asset.buffers)), asset.path)
        name = _name(asset, drawn)
        notes = () if made else in_words(asset)
        if _COPIES in asset.geometry.nodes[drawn.node].extensions:
            notes += (f"{name} is drawn many times by {_COPIES}, which is not read: once here",)
        matrix = asset.world[drawn.node] if drawn.skin is None else shape.matrix
        made.append(shape._replace(name=name, matrix=matrix, notes=notes))
    return made, asset


def _opacity_reader(asset: Gltf) -> Callable[[Primitive, Int64s], Opacity | None] | None:
    """What reads alpha of faces; None if all materials are opaque, which are not read."""
    materials = asset.header.get("materials", [])
    tables = [table for table in materials if isinstance(table, dict)] if isinstance(materials, list) else []
    if all(table.get("alphaMode", "OPAQUE") == "OPAQUE" for table in tables):
        return None
    from .textures import Textures, opacity_of

    return partial(opacity_of, Textures(asset))


def _name(asset: Gltf, drawn: DrawnPrimitive) -> str:
    mesh = asset.geometry.meshes[drawn.mesh]
    name = asset.geometry.nodes[drawn.node].name or mesh.name or f"node {drawn.node}"
    return f"{name}[{drawn.primitive_number}]" if len(mesh.primitives) > 1 else name


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
    if "_OBSCURANCE" not in attributes:
        return None
    try:
        w = values(asset, attributes["_OBSCURANCE"], "SCALAR").ravel()
    except ValueError:
        return None
    return w if len(w) == count and w.dtype.kind == "f" else None


def _stored_profile(asset: Gltf, attributes: dict[str, int], count: int) -> Profile | None:
    """The profile of an earlier bake, unless the attributes of these names are something else."""
    if f"{PROFILE}0" not in attributes:
        return None
    from ao import Profile

    try:
        extras = entry(asset.geometry.accessors, attributes[f"{PROFILE}0"], "accessors").extras
        lengths = extras["half_distances"]
        radius = extras["radius"]
        numbers = [attributes[f"{PROFILE}{number}"] for number in range(-(-len(lengths) // 4))]
        columns = np.hstack([normalized(values(asset, number, "VEC4")) for number in numbers])
    except (KeyError, TypeError, ValueError):
        return None
    return Profile.stored(lengths, columns[:, : len(lengths)], radius) if len(columns) == count else None
