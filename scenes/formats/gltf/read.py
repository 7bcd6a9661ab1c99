"""The triangles that a glTF scene draws at rest, with the transforms of their nodes (Khronos glTF 2.0, section 3.7)."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError

from ...geometry.instances import Instance, check_copies
from ..table import MeshInput
from .accessors import normalized, triangles, values, vectors
from .asset import Gltf, decode, entry
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
    shapes: dict[Any, Instance] = {}
    opacity_of = None
    materials = asset.header.get("materials", [])
    tables = [each for each in materials if isinstance(each, dict)] if isinstance(materials, list) else []
    if given.alpha and any(each.get("alphaMode", "OPAQUE") != "OPAQUE" for each in tables):  # opaque ones are not read
        from .textures import Textures
        from .textures import opacity_of as of

        opacity_of = partial(of, Textures(asset))
    rows = 0
    poses = Poses(asset)
    made: list[Instance] = []
    for piece in asset.drawn:
        if piece.shape not in shapes:
            shape = poses.posed(piece, _shape(asset, piece.primitive))
            shape = replace(shape, opacity=opacity_of(piece.primitive, shape.faces)) if opacity_of else shape
            shapes[piece.shape] = shape
        shape = shapes[piece.shape]
        rows += len(shape.vertices) + len(shape.faces)
        check_copies(rows, sum(map(len, asset.buffers)), asset.path)
        node = asset.geometry.nodes[piece.node]
        mesh = asset.geometry.meshes[piece.mesh]
        name = node.name or mesh.name or f"node {piece.node}"
        name = f"{name}[{piece.place}]" if len(mesh.primitives) > 1 else name
        drawn_once = f"{name} is drawn many times by {_COPIES}, which is not read: once here"
        notes = () if made else in_words(asset)
        notes += (drawn_once,) if _COPIES in node.extensions else ()
        matrix = asset.world[piece.node] if piece.skin is None else shape.matrix
        made.append(replace(shape, name=name, matrix=matrix, notes=notes))
    return made, asset


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
