"""COLLADA by pycollada: geometry where nodes place it, with materials, texture coordinates and colours of vertices.

Of a material are read the colours and the picture of the COMMON profile: diffuse, emission, specular and shininess,
which is taken for the exponent of Blinn–Phong. Format: COLLADA 1.4.1, chapter 8, "FX reference".
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import unquote

import numpy as np

from obscurance.raytrace.mesh.mesh import PerCorner
from obscurance.raytrace.types import Float64s, Int64s

from ..geometry.attributes import SourceAttributes, SourceMaterial, find_picture
from ..geometry.instances import Instance, check_copies
from ..geometry.polygons import triangulate
from .table import MeshInput
from .threemf import check_archive

Colour = tuple[float, float, float]


def read_dae(mesh_input: MeshInput) -> list[Instance]:
    """Every geometry where its nodes place it, its vertices once, whatever uses them.

    Raises: MeshError: very many copies, or an archive that unpacks to very much. Exception: of pycollada.
    """
    from collada import Collada
    from collada.common import DaeError
    from collada.polylist import Polylist
    from collada.triangleset import TriangleSet

    file = mesh_input.file
    if mesh_input.path.suffix.lower() == ".zae":
        check_archive(file, mesh_input.source)
    content = Collada(file, ignore=[DaeError])
    up = str(content.assetInfo.upaxis or "y")[0].lower()
    instances = []
    placed_elements = 0
    for placed in _placed(content.scene) if content.scene else ():
        shape = placed.original
        # Primitives that share vertices are one mesh.
        sets: dict[int, list[Any]] = {}
        for piece in shape.primitives:
            if isinstance(piece, Polylist | TriangleSet) and piece.vertex is not None:
                sets.setdefault(id(piece.vertex), []).append(piece)
        for primitives in sets.values():
            vertices = np.asarray(primitives[0].vertex, np.float64)
            corners = np.concatenate([np.ravel(piece.vertex_index) for piece in primitives]).astype(np.int64)
            counts = [getattr(piece, "vcounts", np.full(len(piece.vertex_index), 3)) for piece in primitives]
            sizes = np.concatenate(counts).astype(np.int64)
            placed_elements += len(vertices) + len(corners)
            check_copies(placed_elements, file.seek(0, os.SEEK_END), mesh_input.path)
            # The polygons' triangles, placed by the node.
            triangles = triangulate(vertices, corners, sizes, mesh_input.source)
            instance = Instance(
                str(shape.name or shape.id),
                vertices,
                triangles.take(corners),
                matrix=np.asarray(placed.matrix, np.float64),
                notes=triangles.notes,
                up=up,
            )
            # What else the mesh has, for an output that can hold it.
            if mesh_input.keep:
                materials, unread = _materials(placed, primitives, mesh_input.path.parent)
                attributes = SourceAttributes(
                    corners,
                    sizes,
                    triangles,
                    uv=_coordinates(primitives),
                    colors=_colours(primitives, len(vertices)),
                    materials=materials,
                    material_of=np.repeat(np.arange(len(primitives)), [len(count) for count in counts]),
                    files=tuple(material.texture for material in materials if material.texture),
                )
                instance = instance._replace(attributes=attributes, unread=unread)
            instances.append(instance)
    if content.errors and instances:
        faults = " ".join(str(getattr(content.errors[0], "msg", content.errors[0])).split())
        left_out = f"{len(content.errors):,} parts of the document are malformed and left out: {faults}"
        instances[0] = instances[0]._replace(notes=(*instances[0].notes, left_out))
    return instances


def _placed(scene: Any) -> Iterator[Any]:
    """The bound geometries of a scene, then those of its skins and morphs, in the pose that they are stored in."""
    from collada.controller import BoundSkin

    yield from scene.objects("geometry")
    for bound in scene.objects("controller"):
        if isinstance(bound, BoundSkin):
            yield bound.geometry
        else:
            yield bound.original.source_geometry.bind(bound.matrix, bound.materialnodebysymbol)


def unit(file: BinaryIO) -> float:
    """The unit that a document names, in metres; 0: none. Raises: Exception: of lxml."""
    from lxml import etree

    secure: dict[str, bool] = {"resolve_entities": False, "no_network": True, "load_dtd": False}
    _, element = next(etree.iterparse(file, tag=("{*}unit", "{*}asset"), **secure))  # the first that ends
    return float(element.get("meter", 1.0)) if element.tag.endswith("unit") else 0.0


def _coordinates(pieces: list[Any]) -> PerCorner | None:
    """The first set of texture coordinates of all corners, NaN where a primitive has none; None if none has."""
    if not any(len(piece.texcoord_indexset) for piece in pieces):
        return None
    values: list[Float64s] = []
    of: list[Int64s] = []
    for piece in pieces:
        start = sum(map(len, values))
        if len(piece.texcoord_indexset):
            of.append(np.ravel(piece.texcoord_indexset[0]).astype(np.int64) + start)
            values.append(np.asarray(piece.texcoordset[0], np.float64)[:, :2])
        else:
            of.append(np.full(np.size(piece.vertex_index), start))
            values.append(np.full((1, 2), np.nan))
    return PerCorner(np.concatenate(values), np.concatenate(of))


def _colours(pieces: list[Any], count: int) -> Float64s | None:
    """Colours (n, 3) of the vertices, each from one of its corners; None unless all primitives have some."""
    colours = np.ones((count, 3))
    for piece in pieces:
        sources = piece.sources.get("COLOR")
        if not sources:
            return None
        offset = sources[0][0]
        values = np.asarray(sources[0][4].data, np.float64)[:, :3]
        places = np.reshape(piece.index, (-1, piece.index.shape[-1]))[:, offset]
        colours[np.ravel(piece.vertex_index)] = values[places].clip(0, 1)
    return colours


def _materials(placed: Any, pieces: list[Any], folder: Path) -> tuple[tuple[SourceMaterial, ...], tuple[str, ...]]:
    """The material of each primitive as its node binds it, and textures that are left out, in words."""
    materials = []
    unread = []
    for piece in pieces:
        node = placed.materialnodebysymbol.get(piece.material)
        material = node.target if node else None
        name = str(piece.material or "default")
        if material is None:
            materials.append(SourceMaterial(name))
            continue
        effect = material.effect
        texture = None
        if sampler := getattr(effect.diffuse, "sampler", None):  # an image in place of a colour
            picture = str(sampler.surface.image.path)
            texture = find_picture(unquote(picture), folder) or find_picture(picture, folder)
            unread += [] if texture else [f"texture of diffuse ({picture})"]
        shininess = effect.shininess
        made = SourceMaterial(
            str(material.name or name),
            _colour(effect.diffuse, 1.0),
            emission=_colour(effect.emission, 0.0),
            specular=_colour(effect.specular, 0.0),
            exponent=float(shininess) if isinstance(shininess, int | float) and shininess > 0 else 0.0,
            texture=texture,
        )
        materials.append(made)
    return tuple(materials), tuple(dict.fromkeys(unread))


def _colour(value: Any, otherwise: float) -> Colour:
    """A colour of an effect, where that is no texture."""
    if not isinstance(value, tuple | list) or len(value) < 3:
        return otherwise, otherwise, otherwise
    red, green, blue = np.clip(np.asarray(value[:3], np.float64), 0, 1).tolist()
    return red, green, blue
