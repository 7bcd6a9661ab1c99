"""The triangles that a glTF scene draws, with the transforms of their nodes.

Format: Khronos glTF 2.0 specification, section 3.7.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace import Opacity
from raytrace.types import Int64s

from ...geometry.instances import Instance, check_copies
from .accessors import entry, normalized, values
from .container import TRIANGLE_STRIP, Gltf, Primitive, primitives
from .nodes import node_matrices

_COPIES = "EXT_mesh_gpu_instancing"


def read_instances(asset: Gltf, alpha: bool = False) -> list[Instance]:
    """The drawn triangle primitives, in the order of `primitives`; those of one mesh share their arrays.

    Args: alpha: whether faces have that of their materials.

    Raises:
        MeshError: compressed values, which are not supported, or very many copies.
        SceneError: an image with alpha is missing.
        ValueError: nodes that are no tree, or indices of what is not there.
    """
    drawn = list(primitives(asset.header))
    world = node_matrices(asset.header)
    arrays: dict[tuple[int, int], _Arrays] = {}
    opacities: dict[tuple[int, int], Opacity | None] = {}
    opacity_of = _opacities(asset) if alpha else None
    rows = 0
    made = []
    for piece in drawn:
        key = (piece.mesh, piece.place)
        if key not in arrays:
            primitive = entry(asset, "meshes", piece.mesh)["primitives"][piece.place]
            arrays[key] = _arrays(asset, primitive)
            opacities[key] = opacity_of(primitive, arrays[key][1]) if opacity_of else None
        vertices, faces, normals, w = arrays[key]
        rows += len(vertices) + len(faces)
        check_copies(rows, sum(map(len, asset.buffers)), asset.path)
        name = _name(piece, asset.header)
        notes = _notes(name, asset.header["nodes"][piece.node])
        opacity = opacities[key]
        made.append(Instance(name, vertices, faces, normals, world[piece.node], notes, w=w, up="y", opacity=opacity))
    return made


def _opacities(asset: Gltf) -> Callable[[dict[str, Any], Int64s], Opacity | None] | None:
    """Alpha of a primitive's faces; None if no material of the asset has any."""
    materials = asset.header.get("materials", [])
    tables = [each for each in materials if isinstance(each, dict)] if isinstance(materials, list) else []
    if all(material.get("alphaMode", "OPAQUE") == "OPAQUE" for material in tables):
        return None
    from .opacity import opacity_of
    from .schema import check_materials
    from .textures import Textures

    check_materials(asset.header, asset.path)
    return partial(opacity_of, Textures(asset))


_Arrays = tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any] | None, npt.NDArray[Any] | None]


def _arrays(asset: Gltf, primitive: dict[str, Any]) -> _Arrays:
    """Vertices, faces, normals and w."""
    attributes = primitive["attributes"]
    if "POSITION" not in attributes:
        raise ValueError("a primitive without POSITION")
    vertices = values(asset, attributes["POSITION"], "VEC3")
    if entry(asset, "accessors", attributes["POSITION"]).get("normalized"):
        vertices = normalized(vertices)
    normals = normalized(values(asset, attributes["NORMAL"], "VEC3")) if "NORMAL" in attributes else None
    if "indices" in primitive:
        corners = values(asset, primitive["indices"], "SCALAR").ravel()
    else:
        corners = np.arange(len(vertices))
    if primitive.get("mode") != TRIANGLE_STRIP:
        return vertices, corners.reshape(-1, 3), normals, _stored_w(asset, attributes, len(vertices))
    faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1) if len(corners) > 2 else corners[:0, None]
    faces[1::2] = faces[1::2, ::-1]
    return vertices, faces.reshape(-1, 3), normals, _stored_w(asset, attributes, len(vertices))


def _stored_w(asset: Gltf, attributes: dict[str, int], count: int) -> npt.NDArray[Any] | None:
    """What a bake has left, unless an attribute of that name is something else."""
    if "_OBSCURANCE" not in attributes:
        return None
    try:
        w = values(asset, attributes["_OBSCURANCE"], "SCALAR").ravel()
    except ValueError:
        return None
    return w if len(w) == count and w.dtype.kind == "f" else None


def _notes(name: str, node: dict[str, Any]) -> tuple[str, ...]:
    if _COPIES not in node.get("extensions", {}):
        return ()
    return (f"{name} is drawn many times by {_COPIES}, which is not read: once here",)


def _name(piece: Primitive, header: dict[str, Any]) -> str:
    mesh = header["meshes"][piece.mesh]
    name: str = header["nodes"][piece.node].get("name") or mesh.get("name") or f"node {piece.node}"
    return f"{name}[{piece.place}]" if len(mesh["primitives"]) > 1 else name
