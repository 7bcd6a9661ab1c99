"""The faces of a mesh file by material and object, as the primitives of a .glb draw them."""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from raytrace.types import Int64s

from ...geometry.instances import Submesh
from ..gltf.asset import DrawnPrimitive, Gltf
from ..load import MeshFile
from .occlusion import material_of, texture_images
from .plain import groups

_NO_MATERIAL = "default"


class Named(NamedTuple):
    """A unique key of a material or object, and its name, which need not be unique."""

    key: Hashable
    name: str


@dataclass(frozen=True, eq=False)
class Piece:
    """Faces of one material in one object."""

    faces: Int64s  # (k,) rows of the mesh's faces
    material: Named
    object: Named
    body: Hashable  # what the object shares with its copies
    image: Hashable  # an image that the material has by the piece's texture coordinates, or None


def pieces(mesh_file: MeshFile, number: int = 0) -> Iterator[Piece]:
    """The pieces of a file, in the order in which `write.document` lists primitives.

    Args: number: of the set of texture coordinates by which materials have their images.
    """
    asset, detail = mesh_file.gltf, mesh_file.detail
    if asset:
        for drawn, part in zip(asset.drawn, mesh_file.parts, strict=True):
            yield _of_gltf(asset, drawn, part, number)
        return
    for group in groups(mesh_file):
        material = detail.paints[group.paint - 1] if detail and group.paint else None
        owner, named = (group.part, group.name), Named(group.paint, material.name if material else _NO_MATERIAL)
        yield Piece(group.faces, named, Named(owner, group.name), owner, material.texture if material else None)


def _of_gltf(asset: Gltf, drawn: DrawnPrimitive, part: Submesh, number: int) -> Piece:
    header, index = asset.header, drawn.primitive.material
    material = material_of(header, index)
    name = material.get("name") or (_NO_MATERIAL if index is None else f"material {index}")
    has_set = f"TEXCOORD_{number}" in drawn.primitive.attributes
    images = texture_images(header, material, number) if has_set else set()
    return Piece(
        np.arange(part.faces.start, part.faces.stop),
        Named(index, str(name)),
        Named(drawn.node, part.name.removesuffix(f"[{drawn.place}]")),
        drawn.mesh,
        min(images, default=None),
    )
