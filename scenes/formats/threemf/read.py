"""3MF: meshes in XML in a ZIP archive, placed by components and build items.

An own reader because damaged archives must neither crash nor grow: nothing is kept of the XML but the numbers, at most
100 times an archive's bytes + 16 MiB are unpacked, and copies are counted before they are made
(evidence/reliability.md).
Format: 3D Manufacturing Format, core specification 1.3, chapters 3 to 5; production extension 1.1 for `path`.
"""

from __future__ import annotations

import os
import zipfile
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from typing import BinaryIO

import numpy as np

from raytrace.errors import MeshError
from raytrace.system.checks import check_memory
from raytrace.types import Float64s

from ...geometry.instances import Instance, check_copies
from ..table import MeshInput

ROOT = "3d/3dmodel.model"
GROWTH, SPARE = 100, 1 << 24  # an archive may unpack to 100 times its size, and always to 16 MiB
MAX_PLACED = 1_000_000
_BLOCK = 1 << 16
_READ = 2  # bytes of memory a byte of XML
_MATERIALS = ("basematerials", "colorgroup", "texture2dgroup", "compositematerials", "multiproperties")

Key = tuple[str, str]  # model file and object id


@dataclass
class _Object:
    name: str
    vertices: array[float] = field(default_factory=lambda: array("d"))
    faces: array[int] = field(default_factory=lambda: array("q"))
    components: list[tuple[Key, Float64s]] = field(default_factory=list)


class _Reader:
    """The target of the XML parser: collects the objects and build items of one model file."""

    def __init__(self, model: str, objects: dict[Key, _Object]) -> None:
        self.model = model
        self.objects = objects
        self.items: list[tuple[Key, Float64s]] = []
        self.current = _Object("")
        self.has_materials = False

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        match tag.rpartition("}")[2]:
            case "object":
                number = attributes["id"]
                self.current = _Object(attributes.get("name", number))
                self.objects[self.model, number] = self.current
            case "vertex":
                self.current.vertices.extend(float(attributes[axis]) for axis in "xyz")
            case "triangle":
                self.current.faces.extend(int(attributes[corner]) for corner in ("v1", "v2", "v3"))
            case "component":
                self.current.components.append(self._placed(attributes))
            case name if name in _MATERIALS:
                self.has_materials = True
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


def read_3mf(given: MeshInput) -> list[Instance]:
    """The meshes where the build items place them, sharing arrays by object; materials are not read.

    Raises: MeshError: what unpacks to very much, or very many copies. Exception: of zipfile and lxml.
    """
    unpacked = check_archive(given.file, given.source)
    # The objects of all models of the archive, and what the root model builds of them.
    objects: dict[Key, _Object] = {}
    readers = _read_models(given.file, objects)
    build = readers[next(name for name in readers if name.endswith(ROOT))].items
    _check_build(build, objects, unpacked, given.source)
    # A shape of each object.
    unread = ("materials and colours",) if any(reader.has_materials for reader in readers.values()) else ()
    shapes = {key: _shape(item, unread) for key, item in objects.items()}
    # Placed by the build items, with the components of each.
    placed = []
    stack = build[::-1]
    while stack:
        key, matrix = stack.pop()
        if len(shapes[key].faces):
            placed.append(replace(shapes[key], matrix=matrix))
        stack.extend((child, matrix @ local) for child, local in objects[key].components[::-1])
    return placed


def _read_models(file: BinaryIO, objects: dict[Key, _Object]) -> dict[str, _Reader]:
    """Readers of an archive's models, by name, at their ends; their objects are added to `objects`."""
    from lxml import etree

    readers: dict[str, _Reader] = {}
    with zipfile.ZipFile(file) as archive:
        models = {_member(entry.filename): entry for entry in archive.infolist() if entry.filename.endswith(".model")}
        for name, entry in models.items():
            readers[name] = _Reader(name, objects)
            parser = etree.XMLParser(target=readers[name], resolve_entities=False, no_network=True, load_dtd=False)
            with archive.open(entry) as content:
                while block := content.read(_BLOCK):
                    parser.feed(block)
            parser.close()
    return readers


def _shape(item: _Object, unread: tuple[str, ...]) -> Instance:
    vertices = np.array(item.vertices).reshape(-1, 3)
    faces = np.array(item.faces).reshape(-1, 3)
    return Instance(item.name, vertices, faces, unread=unread, up="z")


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
