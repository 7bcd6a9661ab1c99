"""The faces of a mesh file by material and object, as the primitives of a .glb draw them."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from obscurance.raytrace.types import Int64s

from ..geometry.attributes import SourceMaterial
from .load import MeshFile

if TYPE_CHECKING:
    from .gltf.asset import Gltf

_NO_MATERIAL = "default"


class Named(NamedTuple):
    """A unique key of a material or object, and its name, which need not be unique."""

    key: Any
    name: str


class PrimitiveGroup(NamedTuple):
    """Faces of one material in one object."""

    part: int  # number of the mesh file's part
    faces: Int64s  # (k,) rows of the mesh's faces, ascending
    material: Named  # its key is the number in the document
    object: Named
    body: Hashable  # what the object shares with its copies
    image: Hashable  # an image that the material has by the group's texture coordinates, or None


def primitive_groups(mesh_file: MeshFile, coordinates: int = 0) -> Iterator[PrimitiveGroup]:
    """The groups of a file, in the order in which `scenes.formats.gltf.write.document` lists primitives.

    Of what is no glTF part by part, object by object, materials ascending.

    Args: coordinates: number of the set by which materials have their images.
    """
    if mesh_file.gltf:
        yield from _groups_of_gltf(mesh_file.gltf, mesh_file, coordinates)
        return
    # Numbers of each face's object and material; -1, none, is the last of a list.
    held = mesh_file.held
    object_of = held.of_faces(held.object_of)
    material_of = held.of_faces(held.material_of)
    object_names = (*held.objects, "")
    materials = (*held.materials, SourceMaterial(_NO_MATERIAL))
    # Faces of one object and material, in runs.
    for number, part in enumerate(mesh_file.parts):
        order = np.lexsort((material_of[part.faces], object_of[part.faces])) + part.faces.start
        kinds = np.stack([object_of[order], material_of[order]], axis=1)
        begins = np.flatnonzero((kinds[1:] != kinds[:-1]).any(axis=1)) + 1
        for faces in np.split(order, begins):
            material_number = int(material_of[faces[0]])
            material = materials[material_number]
            key = number, object_names[object_of[faces[0]]] or part.name
            in_document = Named(material_number + 1, material.name)
            yield PrimitiveGroup(number, faces, in_document, Named(key, key[1]), body=key, image=material.texture)


def _groups_of_gltf(asset: Gltf, mesh_file: MeshFile, coordinates: int) -> Iterator[PrimitiveGroup]:
    """The groups of a glTF file, one for each drawn primitive."""
    from .gltf.occlusion import stored_entry, texture_images

    for number, (drawn, part) in enumerate(zip(asset.drawn, mesh_file.parts, strict=True)):
        index = drawn.primitive.material
        material = stored_entry(asset.header, "materials", index)
        name = material.get("name") or (_NO_MATERIAL if index is None else f"material {index}")
        has_set = f"TEXCOORD_{coordinates}" in drawn.primitive.attributes
        images = texture_images(asset.header, material, coordinates) if has_set else set[int]()
        yield PrimitiveGroup(
            number,
            np.arange(part.faces.start, part.faces.stop),
            Named(index, str(name)),
            Named(drawn.node, part.name.removesuffix(f"[{drawn.primitive_number}]")),
            body=drawn.mesh,
            image=min(images, default=None),
        )
