"""The faces of a mesh file by material and object, as the primitives of a .glb draw them."""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from raytrace.types import Int64s

from .load import MeshFile

_NO_MATERIAL = "default"


class Named(NamedTuple):
    """A unique key of a material or object, and its name, which need not be unique."""

    key: Any
    name: str


@dataclass(frozen=True, eq=False)
class Piece:
    """Faces of one material in one object."""

    part: int  # number of the mesh file's part
    faces: Int64s  # (k,) rows of the mesh's faces, ascending
    material: Named  # its key is the number in the document
    object: Named
    body: Hashable  # what the object shares with its copies
    image: Hashable  # an image that the material has by the piece's texture coordinates, or None


def pieces(mesh_file: MeshFile, coordinates: int = 0) -> Iterator[Piece]:
    """The pieces of a file, in the order in which `write.document` lists primitives.

    Of what is no glTF part by part, object by object, materials ascending.

    Args: coordinates: number of the set by which materials have their images.
    """
    if asset := mesh_file.gltf:
        from .gltf.occlusion import material_of, texture_images

        for number, (drawn, part) in enumerate(zip(asset.drawn, mesh_file.parts, strict=True)):
            index = drawn.primitive.material
            material = material_of(asset.header, index)
            name = material.get("name") or (_NO_MATERIAL if index is None else f"material {index}")
            has_set = f"TEXCOORD_{coordinates}" in drawn.primitive.attributes
            images = texture_images(asset.header, material, coordinates) if has_set else set[int]()
            faces = np.arange(part.faces.start, part.faces.stop)
            owner = Named(drawn.node, part.name.removesuffix(f"[{drawn.place}]"))
            yield Piece(number, faces, Named(index, str(name)), owner, drawn.mesh, min(images, default=None))
        return
    detail, paint = mesh_file.detail, np.zeros(len(mesh_file.mesh.faces), np.int64)
    of, paints = paint, detail.paints if detail else ()
    if detail and detail.paint_of is not None:
        paint = np.repeat(detail.paint_of + 1, detail.triangles.counts)
    if detail and detail.object_of is not None:
        of = np.repeat(detail.object_of + 1, detail.triangles.counts)
    names = ("", *(detail.objects if detail else ()))
    for number, part in enumerate(mesh_file.parts):
        order = np.lexsort((paint[part.faces], of[part.faces])) + part.faces.start
        kinds = np.stack([of[order], paint[order]], axis=1)
        for faces in np.split(order, np.flatnonzero((kinds[1:] != kinds[:-1]).any(axis=1)) + 1):
            own, key = names[of[faces[0]]] or part.name, int(paint[faces[0]])
            name, image = (paints[key - 1].name, paints[key - 1].texture) if key else (_NO_MATERIAL, None)
            yield Piece(number, faces, Named(key, name), Named((number, own), own), (number, own), image)
