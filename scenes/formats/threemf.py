"""3MF: meshes in XML in a ZIP archive, placed by components and build items.

An own reader because damaged archives must neither crash nor grow: nothing is kept of the XML but the numbers, at most
100 times an archive's bytes + 16 MiB are unpacked, and copies are counted before they are made (docs/reliability.md).
Format: 3D Manufacturing Format, core specification 1.3, chapters 3 to 5; production extension 1.1 for `path`; materials
and properties extension 1.2 for `colorgroup`.
"""

from __future__ import annotations

import os
import re
import zipfile
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from itertools import accumulate
from typing import BinaryIO

import numpy as np

from raytrace.errors import MeshError
from raytrace.image.srgb import decode_srgb
from raytrace.system.checks import check_memory
from raytrace.types import Float64s, Int64s

from ..geometry.detail import Paint
from ..geometry.instances import Instance, check_copies
from .table import MeshInput

ROOT = "3d/3dmodel.model"
GROWTH, SPARE = 100, 1 << 24  # an archive may unpack to 100 times its size, and always to 16 MiB
MAX_PLACED = 1_000_000
_BLOCK = 1 << 16
MAX_PAINTS = 4096  # of a .glb, each a primitive wherever it is used
_READ = 2  # bytes of memory a byte of XML
_GROUPS = ("basematerials", "colorgroup")
_MORE_GROUPS = ("texture2dgroup", "compositematerials", "multiproperties")

Key = tuple[str, str]  # model file and object id


@dataclass
class _Object:
    name: str
    vertices: array[float] = field(default_factory=lambda: array("d"))
    faces: array[int] = field(default_factory=lambda: array("q"))
    components: list[tuple[Key, Float64s]] = field(default_factory=list)
    property: tuple[int, int] = (-1, -1)  # group and index of triangles without their own
    properties: array[int] = field(default_factory=lambda: array("i"))  # group and three indices of each, -1: none


class _Reader:
    """The target of the XML parser: collects the objects and build items of one model file."""

    def __init__(self, model: str, objects: dict[Key, _Object], keep: bool) -> None:
        self.model, self.objects, self.keep = model, objects, keep
        self.items: list[tuple[Key, Float64s]] = []
        self.current = _Object("")
        self.groups: dict[int, list[Paint]] = {}
        self.paints: list[Paint] = []
        self.unread: set[str] = set()

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        match tag.rpartition("}")[2]:
            case "object":
                number = attributes["id"]
                self.current = _Object(attributes.get("name", number))
                self.current.property = _index(attributes, "pid"), _index(attributes, "pindex")
                self.objects[self.model, number] = self.current
            case "vertex":
                self.current.vertices.extend(float(attributes[axis]) for axis in "xyz")
            case "triangle":
                self.current.faces.extend(int(attributes[corner]) for corner in ("v1", "v2", "v3"))
                if self.keep:
                    self.current.properties.extend(_index(attributes, name) for name in ("pid", "p1", "p2", "p3"))
            case "component":
                self.current.components.append(self._placed(attributes))
            case name if name in _GROUPS and self.keep:
                self.paints = self.groups.setdefault(_index(attributes, "id"), [])
            case "base" | "color" if self.keep:
                self.paints.append(_paint(attributes))
            case name if name in _MORE_GROUPS or name in _GROUPS:
                self.unread.add("materials and colours")
            case "item":
                self.items.append(self._placed(attributes))

    def _placed(self, attributes: Mapping[str, str]) -> tuple[Key, Float64s]:
        path = next((value for name, value in attributes.items() if name.rpartition("}")[2] == "path"), "")
        matrix = np.eye(4)
        if "transform" in attributes:
            matrix[:3] = np.array(attributes["transform"].split(), np.float64).reshape(4, 3).T
        return (_member(path) or self.model, attributes["objectid"]), matrix

    def close(self) -> None:
        """As the parser asks for."""


def _index(attributes: Mapping[str, str], name: str) -> int:
    """A number that tells one of a list, or -1."""
    text = attributes.get(name, "")
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else -1


def _paint(attributes: Mapping[str, str]) -> Paint:
    """A base material or colour; colours are sRGB."""
    text = attributes.get("displaycolor") or attributes.get("color", "")
    name = attributes.get("name", text)
    if not re.fullmatch("#([0-9A-Fa-f]{6}|[0-9A-Fa-f]{8})", text):
        return Paint(name)
    codes = np.frombuffer(bytes.fromhex(text[1:]), np.uint8) / 255
    red, green, blue = decode_srgb(codes[:3]).tolist()
    return Paint(name, (red, green, blue), float(codes[3]) if len(codes) == 4 else 1.0)


def read_3mf(given: MeshInput) -> list[Instance]:
    """The meshes where the build items place them, sharing arrays by object; with `given.keep` also their paints.

    Raises: MeshError: what unpacks to very much, or very many copies. Exception: of zipfile and lxml.
    """
    from lxml import etree

    file, source = given.file, given.source
    unpacked = check_archive(file, source)
    with zipfile.ZipFile(file) as archive:
        models = {_member(entry.filename): entry for entry in archive.infolist() if entry.filename.endswith(".model")}
        objects: dict[Key, _Object] = {}
        readers = {name: _Reader(name, objects, given.keep) for name in models}
        for name, entry in models.items():
            target = readers[name]
            parser = etree.XMLParser(target=target, resolve_entities=False, no_network=True, load_dtd=False)
            with archive.open(entry) as content:
                while block := content.read(_BLOCK):
                    parser.feed(block)
            parser.close()
    paints, of, unread = _painted(readers, objects)
    build = readers[next(name for name in models if name.endswith(ROOT))].items
    _check_build(build, objects, unpacked, source)
    shapes: dict[Key, Instance] = {}
    for key, item in objects.items():
        vertices, faces = (np.array(numbers).reshape(-1, 3) for numbers in (item.vertices, item.faces))
        shape = Instance(item.name, vertices, faces, unread=unread, up="z", paints=paints)
        shapes[key] = replace(shape, paint_of=of.get(key))
    placed = []
    stack = build[::-1]
    while stack:
        key, matrix = stack.pop()
        if len(shapes[key].faces):
            placed.append(replace(shapes[key], matrix=matrix))
        stack.extend((child, matrix @ local) for child, local in objects[key].components[::-1])
    return placed


def _painted(
    readers: dict[str, _Reader], objects: dict[Key, _Object]
) -> tuple[tuple[Paint, ...], dict[Key, Int64s], tuple[str, ...]]:
    """All materials, which of them each triangle of an object has, -1: none, and what is not read, in words."""
    groups = {(name, number): group for name, reader in readers.items() for number, group in reader.groups.items()}
    paints = tuple(paint for group in groups.values() for paint in group)
    unread = {words for reader in readers.values() for words in reader.unread}
    if len(paints) > MAX_PAINTS:
        return (), {}, tuple(sorted(unread | {f"its {len(paints):,} materials and colours"}))
    firsts = dict(zip(groups, accumulate(map(len, groups.values()), initial=0), strict=False))
    of: dict[Key, Int64s] = {}
    for key, item in objects.items() if paints else ():
        rows = np.array(item.properties, np.int64).reshape(-1, 4)
        own = np.where(rows[:, 0] < 0, item.property[0], rows[:, 0])
        index = np.where(rows[:, 1] < 0, item.property[1], rows[:, 1])
        of[key] = np.full(len(rows), -1)
        for number in np.unique(own):
            group = key[0], int(number)
            chosen = (own == number) & (index >= 0) & (index < len(groups.get(group, ())))
            of[key][chosen] = firsts.get(group, 0) + index[chosen]
        if ((rows[:, 2:] >= 0) & (rows[:, 2:] != rows[:, 1:2])).any():
            unread.add("colours that vary within triangles")
    return paints, of, tuple(sorted(unread))


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
    rows, count = dict[Key, int](), dict[Key, int]()
    try:
        for key in TopologicalSorter(graph).static_order():
            own = len(objects[key].vertices) // 3 + len(objects[key].faces) // 3
            rows[key] = own + sum(rows[child] for child in graph[key])
            count[key] = 1 + sum(count[child] for child in graph[key])
    except CycleError as fault:
        field = f"object {fault.args[1][0][1]}"
        raise MeshError(source, field, "components other than itself", "a cycle") from None
    check_copies(sum(rows[key] for key, _ in build), stored, source)
    placed = sum(count[key] for key, _ in build)
    if placed > MAX_PLACED:
        raise MeshError(source, "build", f"at most {MAX_PLACED:,} objects with all copies", f"{placed:,}")
