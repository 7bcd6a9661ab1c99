"""3MF: meshes in XML in a ZIP archive, placed by components and build items.

An own reader because damaged archives must neither crash nor grow: nothing is kept of the XML but the numbers, at most
100 times an archive's bytes + 16 MiB are unpacked, and copies are counted before they are made
(evidence/reliability.md).
Format: 3D Manufacturing Format, core specification 1.3, chapters 3 to 5; materials and properties extension 1.2,
chapter 2, for `colorgroup`; production extension 1.1 for `path`.
"""

from __future__ import annotations

import os
import re
import zipfile
from array import array
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from typing import BinaryIO

import numpy as np

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.types import Float64s

from ..asset.asset import Asset, Node
from ..asset.material import Material
from ..asset.primitive import Primitive
from ..geometry.instances import check_copies
from .table import MeshInput

ROOT = "3d/3dmodel.model"
GROWTH, SPARE = 100, 1 << 24  # an archive may unpack to 100 times its size, and always to 16 MiB
MAX_PLACED = 1_000_000
_BLOCK = 1 << 16
_READ = 2  # bytes of memory a byte of XML
_COLOURED = ("basematerials", "colorgroup")
_UNREAD = ("texture2dgroup", "compositematerials", "multiproperties")
_UNITS = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}
_EXTENSIONS = "/material/", "/production/"  # in their namespaces
_DATE = re.compile(r"(/\d+)+$")
_SECURE: dict[str, bool] = {"resolve_entities": False, "no_network": True, "load_dtd": False}
_MOST_COLOURS = 1024  # of a file, each of which is a material

Key = tuple[str, str]  # model file and object id
Paint = tuple[str, str]  # id of a group of colours, and the number of one in it


@dataclass
class _Object:
    name: str
    vertices: array[float] = field(default_factory=lambda: array("d"))
    faces: array[int] = field(default_factory=lambda: array("q"))
    components: list[tuple[Key, Float64s]] = field(default_factory=list)
    paints: list[Paint | None] = field(default_factory=list)  # of each face
    paint: Paint | None = None  # of faces without their own


@dataclass
class _Reader:
    """The target of the XML parser: collects the objects and build items of one model file."""

    model: str
    objects: dict[Key, _Object]
    items: list[tuple[Key, Float64s]] = field(default_factory=list)
    current: _Object = field(default_factory=lambda: _Object(""))
    group: str = ""
    unit: str = "millimeter"
    colours: dict[Paint, Material] = field(default_factory=dict)
    sizes: Counter[str] = field(default_factory=Counter)  # of groups, as far as they are read
    has_unread: bool = False
    core: str = ""  # the namespace of what is no extension
    unread: dict[str, None] = field(default_factory=dict)  # names of extensions

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Take the start of an XML element, as the parser calls it."""
        namespace, _, element = tag.rpartition("}")
        if element == "model":
            self.core = namespace
        if namespace != self.core and not any(extension in namespace for extension in _EXTENSIONS):
            self.unread[_DATE.sub("", namespace[1:]).rpartition("/")[2]] = None  # as slices, whose vertices have no z
            return
        match element:
            case "model":
                self.unit = attributes.get("unit", self.unit)
            case "object":
                number = attributes["id"]
                self.current = _Object(attributes.get("name", number))
                self.objects[self.model, number] = self.current
                if "pid" in attributes:
                    self.current.paint = attributes["pid"], attributes.get("pindex", "0")
            case "vertex":
                self.current.vertices.extend(float(attributes[axis]) for axis in "xyz")
            case "triangle":
                self.current.faces.extend(int(attributes[corner]) for corner in ("v1", "v2", "v3"))
                paint = self.current.paint
                if "p1" in attributes:  # at its first corner
                    paint = attributes.get("pid") or (paint or ("", ""))[0], attributes["p1"]
                self.current.paints.append(paint)
            case "component":
                self.current.components.append(self._placed(attributes))
            case name if name in _COLOURED:
                self.group = attributes["id"]
            case "base" | "color":
                code = attributes.get("displaycolor", attributes.get("color", ""))
                self._add_colour(attributes.get("name", ""), code)
            case name if name in _UNREAD:
                self.has_unread = True
            case "item":
                self.items.append(self._placed(attributes))

    def _add_colour(self, name: str, code: str) -> None:
        """Add a colour "#RRGGBB" or "#RRGGBBAA", sRGB, to the group that is read."""
        number = self.sizes[self.group]
        self.sizes[self.group] += 1
        if not re.fullmatch("#([0-9A-Fa-f]{6}|[0-9A-Fa-f]{8})", code):
            self.has_unread = True
            return
        codes = np.frombuffer(bytes.fromhex(code[1:7]), np.uint8)
        red, green, blue = decode_srgb(codes / 255).tolist()
        self.colours[self.group, str(number)] = Material(name or code, (red, green, blue))

    def _placed(self, attributes: Mapping[str, str]) -> tuple[Key, Float64s]:
        """The object that an item or component refers to, and its matrix (4, 4)."""
        path = next((value for name, value in attributes.items() if name.rpartition("}")[2] == "path"), "")
        matrix = np.eye(4)
        if "transform" in attributes:
            matrix[:3] = np.array(attributes["transform"].split(), np.float64).reshape(4, 3).T
        return (_member(path) or self.model, attributes["objectid"]), matrix

    def close(self) -> None:
        """Nothing to do at the end of the file, but the parser asks for the method."""


def read_3mf(mesh_input: MeshInput) -> Asset:
    """The meshes where the build items place them, sharing arrays by object.

    Of materials are read the colours of faces, at the first corner of each.

    Raises: MeshError: what unpacks to very much, or very many copies. Exception: of zipfile and lxml.
    """
    unpacked = check_archive(mesh_input.file, mesh_input.source)
    # The objects of all models of the archive, and what the root model builds of them.
    objects: dict[Key, _Object] = {}
    readers = _read_models(mesh_input.file, objects)
    root = next(iter(readers.values()))
    build = root.items
    _check_build(build, objects, unpacked, mesh_input.source)
    colours = {name: reader.colours for name, reader in readers.items()}
    has_unread = any(reader.has_unread for reader in readers.values())
    if sum(map(len, colours.values())) > _MOST_COLOURS:
        colours = {}
        has_unread = True
    unread = unit_in_words(_UNITS.get(root.unit, 1.0))
    if has_unread:
        unread += ("colours of textures or mixtures, of very many kinds, or malformed",)
    materials: dict[Material, int] = {}
    # Placed by the build items, with the components of each.
    numbers: dict[Key, int] = {}
    primitives: list[Primitive] = []
    nodes = []
    stack = build[::-1]
    while stack:
        key, matrix = stack.pop()
        item = objects[key]
        if len(item.faces):
            if numbers.setdefault(key, len(primitives)) == len(primitives):
                primitives.append(_primitive(item, colours.get(key[0], {}), materials))
            nodes.append(Node(item.name, (numbers[key],), matrix))
        stack.extend((child, matrix @ local) for child, local in item.components[::-1])
    extensions = dict.fromkeys(name for reader in readers.values() for name in reader.unread)
    notes = {f"what the 3MF extension {name} adds is not read": None for name in extensions}
    return Asset(
        mesh_input.path, tuple(primitives), tuple(nodes), tuple(materials), up="z", warnings=notes, unread=unread
    )  # fmt: skip


def unit(file: BinaryIO) -> float:
    """The unit of an archive's root model in metres. Raises: Exception: of zipfile and lxml, or another unit."""
    from lxml import etree

    with zipfile.ZipFile(file) as archive, archive.open(_root(archive)) as content:
        _, model = next(etree.iterparse(content, events=("start",), **_SECURE))
    return _UNITS[model.get("unit", "millimeter")]


def unit_in_words(unit: float) -> tuple[str, ...]:
    """What outputs without a unit, or with metres, lose of coordinates in a unit of so many metres, in words."""
    return () if unit == 1 else (f"its unit, {unit:g} m",)


def _read_models(file: BinaryIO, objects: dict[Key, _Object]) -> dict[str, _Reader]:
    """Readers of an archive's models, by name, at their ends, that of the root first; their objects are added to
    `objects`."""
    from lxml import etree

    readers: dict[str, _Reader] = {}
    with zipfile.ZipFile(file) as archive:
        models = [entry for entry in archive.namelist() if entry.endswith(".model")]
        for entry in dict.fromkeys([_root(archive), *models]):
            name = _member(entry)
            readers[name] = _Reader(name, objects)
            parser = etree.XMLParser(target=readers[name], **_SECURE)
            with archive.open(entry) as content:
                while block := content.read(_BLOCK):
                    parser.feed(block)
            parser.close()
    return readers


def _root(archive: zipfile.ZipFile) -> str:
    """The member that is the root model: by the package's relations, or else by its usual name. Raises: ValueError."""
    from lxml import etree

    names = {_member(name): name for name in archive.namelist()}
    if relations := names.get("_rels/.rels"):
        with archive.open(relations) as content:
            for _, relation in etree.iterparse(content, tag="{*}Relationship", recover=True, **_SECURE):
                target = _member(relation.get("Target", ""))
                if relation.get("Type", "").endswith("/3dmodel") and target in names:
                    return names[target]
    usual = [name for member, name in names.items() if member.endswith(ROOT)]
    if not usual:
        raise ValueError("no model")
    return usual[0]


def _primitive(item: _Object, colours: Mapping[Paint, Material], materials: dict[Material, int]) -> Primitive:
    """The triangles of an object. Args: materials: numbers of those of the file, which gets the object's."""
    used = [paint for paint in dict.fromkeys(item.paints) if paint and paint in colours]
    number: dict[Paint | None, int] = {
        paint: materials.setdefault(colours[paint], len(materials)) for paint in used if paint
    }
    material_of = np.array([number.get(paint, -1) for paint in item.paints], np.int64) if used else None
    positions = np.array(item.vertices).reshape(-1, 3)
    corners = np.array(item.faces)
    return Primitive.of(positions, corners, material=material_of)


def check_archive(file: BinaryIO, source: str) -> int:
    """The bytes that a ZIP archive unpacks to. Raises: MeshError: beyond measure. MemoryLimitError."""
    limit = GROWTH * file.seek(0, os.SEEK_END) + SPARE
    with zipfile.ZipFile(file) as archive:
        unpacked = sum(entry.file_size for entry in archive.infolist())
    file.seek(0)
    if unpacked > limit:
        raise MeshError(source, "content", f"an archive that unpacks to at most {limit:,} bytes", f"{unpacked:,}")
    check_memory(source, _READ * unpacked, f"to read {unpacked:,} bytes of XML")
    return unpacked


def _member(path: str) -> str:
    """The name of an archive's member, in lower case and without the first slash."""
    return path.strip("/").lower()


def _check_build(build: list[tuple[Key, Float64s]], objects: dict[Key, _Object], stored: int, source: str) -> None:
    """Count what is placed before it is made: a few objects of components can mean any number of copies."""
    graph: dict[Key, list[Key]] = {}
    stack = [key for key, _ in build]
    while stack:
        key = stack.pop()
        if key not in objects:
            raise MeshError(source, f"object {key[1]}", "an object of the file", "none")
        if key not in graph:
            graph[key] = [child for child, _ in objects[key].components]
            stack += graph[key]
    # Rows and objects of each with all of its components, children first.
    total_of = dict[Key, int]()
    count = dict[Key, int]()
    try:
        for key in TopologicalSorter(graph).static_order():
            own_rows = len(objects[key].vertices) // 3 + len(objects[key].faces) // 3
            total_of[key] = own_rows + sum(total_of[child] for child in graph[key])
            count[key] = 1 + sum(count[child] for child in graph[key])
    except CycleError as fault:
        field = f"object {fault.args[1][0][1]}"
        raise MeshError(source, field, "components other than itself", "a cycle") from None
    check_copies(sum(total_of[key] for key, _ in build), stored, source)
    placed = sum(count[key] for key, _ in build)
    if placed > MAX_PLACED:
        raise MeshError(source, "build", f"at most {MAX_PLACED:,} objects with all copies", f"{placed:,}")


FORMATS = (
    {
        "ending": ".3mf",
        "name": "3MF",
        "read": "obscurance.scenes.formats.threemf:read_3mf",
        "peak": 1.0,
        "begins": rb"PK\x03\x04",
        "unit": "obscurance.scenes.formats.threemf:unit",
    },
)
