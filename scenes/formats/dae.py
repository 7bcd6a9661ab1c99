"""COLLADA by pycollada: geometry where nodes place it, with materials, normals, texture coordinates and colours.

Of a material are read the colours and the picture of the COMMON profile: diffuse, emission, specular and shininess,
which is taken for the exponent of Blinn–Phong. Format: COLLADA 1.4.1, chapter 8, "FX reference".
"""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import unquote

import numpy as np

from obscurance.raytrace.types import Float64s, Int64s

from ..asset.asset import Asset, Node
from ..asset.material import Colour, Material, find_picture, picture
from ..asset.primitive import COLOR, NORMAL, Column, ColumnSet, Primitive
from ..geometry.instances import check_copies
from .table import MeshInput
from .threemf import check_archive, unit_in_words


def read_dae(mesh_input: MeshInput) -> Asset:
    """Every geometry where its nodes place it, its vertices once, whatever uses them.

    Raises: MeshError: very many copies, or an archive that unpacks to very much. Exception: of pycollada.
    """
    file = mesh_input.file
    if mesh_input.path.suffix.lower() == ".zae":
        check_archive(file, mesh_input.source)
    content = _content(file)
    primitives: list[Primitive] = []
    nodes = []
    materials: dict[Material, int] = {}
    unread: dict[str, None] = {}
    placed_elements = 0
    scene = content.scene or next(iter(content.scenes), None)
    for placed in scene.objects("geometry") if scene else ():
        shape = placed.original
        for pieces in _sharing_vertices(shape.primitives):
            placed_elements += len(pieces[0].vertex) + sum(np.size(piece.vertex_index) for piece in pieces)
            check_copies(placed_elements, file.seek(0, os.SEEK_END), mesh_input.path)
            primitive = _primitive(pieces, mesh_input.source, unread)
            used = _materials(placed, pieces, mesh_input.path.parent, unread)
            numbers = [materials.setdefault(material, len(materials)) for material in used]
            of_pieces = [len(_counts(piece)) for piece in pieces]
            nodes.append(Node(str(shape.name or shape.id), (len(primitives),), np.asarray(placed.matrix, np.float64)))
            primitives.append(primitive._replace(material=np.repeat(numbers, of_pieces)))
    notes: dict[str, None] = {}
    if content.errors:
        faults = " ".join(str(getattr(content.errors[0], "msg", content.errors[0])).split())
        notes[f"{len(content.errors):,} parts of the document are malformed and left out: {faults}"] = None
    left_out = [name for name in ("cameras", "lights", "animations") if getattr(content, name)]
    unread |= dict.fromkeys([*left_out, *unit_in_words(content.assetInfo.unitmeter or 1.0)])
    up = str(content.assetInfo.upaxis or "y")[0].lower()
    pictures = tuple(path for material in materials for path in material.pictures)
    return Asset(
        mesh_input.path, tuple(primitives), tuple(nodes), tuple(materials),
        up=up, warnings=notes, unread=tuple(unread), pictures=pictures,
    )  # fmt: skip


def _content(file: BinaryIO) -> Any:
    """The document; what is malformed is left out. Raises: Exception: of pycollada."""
    from collada import Collada
    from collada.common import DaeBrokenRefError, DaeError
    from collada.xmlutil import etree

    class Document(Collada):  # type: ignore[misc]
        def _loadNodes(self) -> None:
            """Load nodes without what would lose their geometry: materials that are not there, skins and morphs."""
            for technique in self.xmlnode.iter(self.tag("technique_common")):
                for bound in technique.findall(self.tag("instance_material")):
                    target = str(bound.get("target")).removeprefix("#")
                    if target not in self.materials:
                        technique.remove(bound)
                        self.handleError(DaeBrokenRefError(f"Material #{target} not found"))
            for node in list(self.xmlnode.iter(self.tag("node"))):
                for instance in node.findall(self.tag("instance_controller")):
                    node.remove(instance)
                    self._place(etree.SubElement(node, self.tag("node")), instance)
            super()._loadNodes()

        def _place(self, node: Any, instance: Any) -> None:
            """Make an instance of a controller one of the geometry that it moves, in the pose of that as stored."""
            controllers = {f"#{element.get('id')}": element for element in self.xmlnode.iter(self.tag("controller"))}
            url = instance.get("url")
            while (controller := controllers.pop(url, None)) is not None:  # a skin may be one of a morph
                for shape in (*controller.iter(self.tag("skin")), *controller.iter(self.tag("morph"))):
                    url = shape.get("source")
                    for matrix in shape.iter(self.tag("bind_shape_matrix")):
                        etree.SubElement(node, self.tag("matrix")).text = matrix.text
            instance.tag = self.tag("instance_geometry")
            instance.set("url", url)
            node.append(instance)

    return Document(file, ignore=[DaeError])


def _sharing_vertices(pieces: Iterable[Any]) -> Iterator[list[Any]]:
    """The polygons and triangles of a geometry, together those that share vertices, which are one mesh."""
    from collada.polylist import Polylist
    from collada.triangleset import TriangleSet

    sets: dict[int, list[Any]] = {}
    for piece in pieces:
        if isinstance(piece, Polylist | TriangleSet) and piece.vertex is not None:
            sets.setdefault(id(piece.vertex), []).append(piece)
    yield from sets.values()


def _primitive(pieces: list[Any], source: str, unread: dict[str, None]) -> Primitive:
    """Primitives of a geometry that share vertices, as one. Args: unread: gets what is left out, in words."""
    vertices = np.asarray(pieces[0].vertex, np.float64)
    corners = np.concatenate([np.ravel(piece.vertex_index) for piece in pieces]).astype(np.int64)
    sizes = np.concatenate([_counts(piece) for piece in pieces]).astype(np.int64)
    columns: dict[str, Column] = {}
    if uv := _column(pieces, "TEXCOORD", 2):
        columns["uv0"] = uv
    if normals := _column(pieces, "NORMAL", 3):
        columns[NORMAL] = normals.of_vertices(corners, len(vertices))
    if all(piece.sources.get("COLOR") for piece in pieces) and (colours := _column(pieces, "COLOR", 3)):
        of_vertices = np.ones((len(vertices), 3))
        of_vertices[corners] = colours.values[colours.of].clip(0, 1)
        columns[COLOR] = Column(of_vertices, srgb=True)
        if colours.of_vertices(corners, len(vertices)).of is not None:
            unread["colours of corners, where a vertex has several"] = None
    return Primitive.of(vertices, corners, sizes, source, columns=ColumnSet(columns))


def _counts(piece: Any) -> Any:
    """How many corners each polygon of a primitive has."""
    return getattr(piece, "vcounts", np.full(len(piece.vertex_index), 3))


def unit(file: BinaryIO) -> float:
    """The unit that a document names, in metres; 0: none. Raises: Exception: of lxml."""
    from lxml import etree

    secure: dict[str, bool] = {"resolve_entities": False, "no_network": True, "load_dtd": False}
    _, element = next(etree.iterparse(file, tag=("{*}unit", "{*}asset"), **secure))  # the first that ends
    return float(element.get("meter", 1.0)) if element.tag.endswith("unit") else 0.0


def _column(pieces: list[Any], semantic: str, width: int) -> Column | None:
    """The first values of a semantic by the corners of all primitives, NaN where one has none; None if none has."""
    values: list[Float64s] = []
    of: list[Int64s] = []
    for piece in pieces:
        found = piece.sources.get(semantic)
        own = np.full((1, width), np.nan)
        rows = np.zeros(np.size(piece.vertex_index), np.int64)
        if found:
            own = np.asarray(found[0][4].data, np.float64)[:, :width]
            rows = np.reshape(piece.index, (-1, piece.index.shape[-1]))[:, found[0][0]].astype(np.int64)
        of.append(rows + sum(map(len, values)))
        values.append(own)
    if not any(piece.sources.get(semantic) for piece in pieces):
        return None
    return Column(np.concatenate(values), np.concatenate(of))


def _materials(placed: Any, pieces: list[Any], folder: Path, unread: dict[str, None]) -> Iterator[Material]:
    """The material of each primitive as its node binds it. Args: unread: gets textures that are left out, in words."""
    for piece in pieces:
        node = placed.materialnodebysymbol.get(piece.material)
        material = node.target if node else None
        name = str(piece.material or "default")
        if material is None:
            yield Material(name)
            continue
        effect = material.effect
        texture = None
        if sampler := getattr(effect.diffuse, "sampler", None):  # an image in place of a colour
            path = str(sampler.surface.image.path)
            texture = find_picture(unquote(path), folder) or find_picture(path, folder)
            if not texture:
                unread[f"texture of diffuse ({path})"] = None
        shininess = effect.shininess
        yield Material(
            str(material.name or name),
            _colour(effect.diffuse, 1.0),
            emission=_colour(effect.emission, 0.0),
            specular=_colour(effect.specular, 0.0),
            exponent=float(shininess) if isinstance(shininess, int | float) and shininess > 0 else 0.0,
            texture=picture(texture),
        )


def _colour(value: Any, otherwise: float) -> Colour:
    """A colour of an effect, where that is no texture."""
    if not isinstance(value, tuple | list) or len(value) < 3:
        return otherwise, otherwise, otherwise
    red, green, blue = np.clip(np.asarray(value[:3], np.float64), 0, 1).tolist()
    return red, green, blue


FORMATS = (
    {
        "ending": ".dae",
        "name": "COLLADA",
        "read": "obscurance.scenes.formats.dae:read_dae",
        "peak": 22.0,
        "begins": rb"(?s)(\xef\xbb\xbf)?\s*(<\?xml.*?\?>\s*)?(<!--.*?-->\s*)*<COLLADA\b",
        "unit": "obscurance.scenes.formats.dae:unit",
    },
    {"ending": ".zae", "name": "COLLADA", "read": "obscurance.scenes.formats.dae:read_dae", "peak": 22.0},
)
