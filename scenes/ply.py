"""PLY through trimesh, and by ourselves where it cannot: binary faces with different numbers of corners.

Format: Greg Turk, The PLY polygon file format, 1994.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np

from raytrace.errors import MeshError

from .flatten import Instance, instance
from .polygons import fan_triangles

_TYPES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d",
}  # fmt: skip
_INDICES = ("vertex_indices", "vertex_index")


@dataclass
class _Element:
    name: str
    count: int
    # Name, type of the values, type of the number of values in a list or "" for a single value.
    properties: list[tuple[str, str, str]] = field(default_factory=list)


def read_ply(file: BinaryIO, name: str, source: str) -> list[Instance]:
    """The vertices and triangles of a PLY file, with its normals if it has `nx ny nz`.

    Raises:
        MeshError: the file ends early.
        Exception: whatever trimesh raises on a malformed file.
    """
    from trimesh.exchange.load import mesh_loaders

    try:
        loaded = mesh_loaders["ply"](file_obj=file, fix_texture=False, skip_materials=True)
        _check_rows(loaded["metadata"]["_ply_raw"], source)
        return [instance(name, loaded, normals=loaded.get("vertex_normals"))]
    except MeshError:
        raise
    except ValueError:
        file.seek(0)
        mixed = _read_mixed(file.read(), name, source)
        if mixed is None:
            raise
        return [mixed]


def _read_mixed(data: bytes, name: str, source: str) -> Instance | None:
    """Vertices and fans of the polygons of a binary PLY file. None if it is not binary.

    Raises:
        MeshError: the file ends early, or has no vertices or faces as PLY names them.
        ValueError, KeyError: a header that is not PLY's.
    """
    header, end, _rest = data.partition(b"end_header")
    lines = [line.split() for line in header.decode("latin-1").splitlines()]
    formats = [line[1] for line in lines if line[:1] == ["format"]]
    if not end or formats not in (["binary_little_endian"], ["binary_big_endian"]):
        return None
    order = "<" if formats == ["binary_little_endian"] else ">"
    start = data.index(b"\n", len(header)) + 1
    vertices = normals = None
    for element in _elements(lines):
        if element.name == "vertex" and not any(counted for *_, counted in element.properties):
            row = np.dtype([(label, order + kind) for label, kind, _ in element.properties])
            if start + element.count * row.itemsize > len(data):
                raise MeshError(source, "element vertex", f"{element.count} rows", "an end before that")
            rows = np.frombuffer(data, row, element.count, start)
            start += rows.nbytes
            vertices = np.stack([rows[axis] for axis in "xyz"], axis=1)
            if row.names and {"nx", "ny", "nz"} <= set(row.names):
                normals = np.stack([rows[axis] for axis in ("nx", "ny", "nz")], axis=1)
            continue
        polygons, start = _lists(data, start, order, element, source)
        if element.name == "face" and vertices is not None:
            sizes = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
            corners = np.array([corner for polygon in polygons for corner in polygon], dtype=np.int64)
            return Instance(name, vertices, fan_triangles(corners, sizes), normals)
    raise MeshError(source, "elements", "vertex and then face", "others")


def _check_rows(elements: dict[str, Any], source: str) -> None:
    """Find what trimesh lets through: an ASCII file that ends early, uneven lists that are as long as even ones."""
    for name, element in elements.items():
        data = element.get("data")
        if isinstance(data, np.ndarray) and data.dtype.names:
            lists = [data[label] for label in data.dtype.names if data.dtype[label].names]
            if any((column["f0"] != column["f1"].shape[1]).any() for column in lists):
                raise ValueError("lists of different lengths")
        for column in data.values() if isinstance(data, dict) else ():
            if len(column) != element["length"]:
                raise MeshError(source, f"element {name}", f"{element['length']} rows", len(column))
            if column.dtype == object and len(column[-1]) == 0:
                raise MeshError(source, f"element {name}", "complete rows", "a row that ends early")


def _elements(lines: list[list[str]]) -> list[_Element]:
    elements: list[_Element] = []
    for words in lines:
        if words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2])))
        elif words[:2] == ["property", "list"]:
            elements[-1].properties.append((words[4], _TYPES[words[3]], _TYPES[words[2]]))
        elif words[:1] == ["property"]:
            elements[-1].properties.append((words[2], _TYPES[words[1]], ""))
    if any(element.count < 0 for element in elements):
        raise ValueError("a negative number of rows")
    return [element for element in elements if element.properties]


def _lists(data: bytes, start: int, order: str, element: _Element, source: str) -> tuple[list[tuple[int, ...]], int]:
    """The vertex indices of each row, and where the element ends."""
    plan = [
        (struct.Struct(order + (counted or kind)), order + "{}" + kind if counted else "", label in _INDICES)
        for label, kind, counted in element.properties
    ]
    rows = []
    try:
        for _ in range(element.count):
            for first, items, wanted in plan:
                (value,) = first.unpack_from(data, start)
                start += first.size
                if items:
                    layout = items.format(value)
                    if wanted:
                        rows.append(struct.unpack_from(layout, data, start))
                    start += struct.calcsize(layout)
    except struct.error:
        start = len(data) + 1
    if start > len(data):
        raise MeshError(source, f"element {element.name}", f"{element.count} rows", "an end before that")
    return rows, start
