"""PLY, text and binary.

An own reader because properties, polygons and the order of vertices are kept for the output, and memory stays bounded:
estimated at 7.5 times the bytes of a file, where what trimesh reads takes 22 times (docs/reliability.md).
Format: Greg Turk, The PLY polygon file format, 1994. The numbers of a text file become a binary one of doubles, so
that both are read alike. No count is trusted: rows are looked for in the bytes that are there.
"""

from __future__ import annotations

import re
import struct
from array import array
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError
from raytrace.mesh.up import UP
from raytrace.types import Float64s, Int64s

from ...geometry.elements import Element, Property
from ...geometry.instances import Instance
from ...geometry.polygons import triangulate
from .detail import ply_detail

_TYPES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d",
    "int64": "q", "uint64": "Q",
}  # fmt: skip
ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
AXES = ("x", "y", "z")
AXES = ("x", "y", "z")
INDICES = ("vertex_indices", "vertex_index")
_END = re.compile(rb"^end_header[ \t\r]*\n", re.MULTILINE)
COUNT = "number of "
UP_COMMENT = "comment up "  # of files of ours, and an axis

Columns = dict[str, npt.NDArray[Any]]
Lists = dict[str, tuple[npt.NDArray[Any], Int64s]]  # all values, and how many each row has


@dataclass
class PlyElement:
    """An element as a header declares it."""

    name: str
    count: int
    # By name: the type of the values, and of the number of values in a list or "" for a single value.
    properties: dict[str, tuple[str, str]] = field(default_factory=dict)


def read_ply(data: bytes, name: str, source: str, keep: bool = False) -> list[Instance]:
    """The vertices and triangles of a PLY file, polygons cut into triangles, with its normals if it has `nx ny nz`.

    Args:
        data: the file's bytes.
        name: what to call the instance.
        source: the file's name for messages.
        keep: also give all elements, as the instance's detail.

    Raises:
        MeshError: the file ends early, or has no vertices.
        ValueError, KeyError: anything else that is not PLY.
    """
    header, order, start = ply_header(data)
    elements = ply_elements(header)
    text = order == "ascii"
    declared = {element.name: element.properties for element in elements}
    stored = []
    found, expected = [], [np.empty(0, np.int64)]
    if text:
        lines = data[start:].decode("ascii")
        found = [count for count in (len(line.split()) for line in lines.splitlines()) if count]
        data, start = np.fromstring(lines, sep=" ").tobytes(), 0
        for element in elements:
            element.properties = {name: ("d", counted and "d") for name, (_, counted) in element.properties.items()}
    vertices = normals = w = None
    corners, sizes = np.empty(0, np.int64), np.empty(0, np.int64)
    for element in elements:
        columns, lists, start = _rows(data, start, ORDERS[order], element, source)
        if keep:
            stored.append(_stored(element, declared[element.name], columns, lists, text))
        singles = np.full(element.count, len(columns))
        expected.append(sum((1 + sizes for _, sizes in lists.values()), singles))
        if element.name == "vertex" and element.count:
            vertices = np.stack([columns[axis] for axis in "xyz"], axis=1)
            w = columns.get("obscurance")
            if {"nx", "ny", "nz"} <= set(columns):
                normals = np.stack([columns[axis] for axis in ("nx", "ny", "nz")], axis=1)
        elif element.name == "face":
            corners, sizes = next((lists[label] for label in INDICES if label in lists), (corners, sizes))
    if text and not np.array_equal(found, np.concatenate(expected)):
        raise MeshError(source, "rows", "one line for each, with as many numbers as the header says", "others")
    if vertices is None:
        raise MeshError(source, "elements", "one of vertices", "none")
    corners = _whole(corners)
    triangles = triangulate(vertices, corners, sizes, source)
    comments = ply_comments(header)
    ups = [line.removeprefix(UP_COMMENT) for line in comments if line.startswith(UP_COMMENT)]
    up = ups[0] if ups and ups[0] in UP else None
    detail = ply_detail(tuple(stored), comments, corners, sizes, triangles) if keep else None
    made = Instance(name, vertices, triangles.take(corners), normals, None, triangles.notes, detail, w=w, up=up)
    return [replace(made, polygons=triangles.polygons)]


def _stored(
    element: PlyElement, declared: dict[str, tuple[str, str]], columns: Columns, lists: Lists, text: bool
) -> Element:
    """The element in its declared types. Of `text` float is double where it would overflow, or move vertices."""
    made = []
    far = text and {*AXES} <= set(columns) and _is_moved(np.stack([columns[axis] for axis in AXES], axis=1))
    for name, (kind, counted) in declared.items():
        values, sizes = lists.get(name, (columns.get(name, np.empty(0, kind)), None))
        if text and kind == "f":
            single = values.astype("f")
            kind = "d" if (far and name in AXES) or (np.isinf(single) & np.isfinite(values)).any() else "f"
            values = values.astype(kind)
        made.append(Property(name, kind, values, counted, sizes))
    return Element(element.name, element.count, tuple(made))


def _is_moved(vertices: Float64s) -> bool:
    """Whether float32 moves vertices by more than what it is in error of an extent about zero."""
    extent = np.ptp(vertices, axis=0).max()
    return not np.abs(vertices.astype("f") - vertices).max() <= 1e-6 * extent


def ply_header(data: bytes) -> tuple[list[list[str]], str, int]:
    """The words of the header's lines, the format, and where the data starts. Raises: ValueError: it is no PLY."""
    end = _END.search(data)
    if data[:3] != b"ply" or not end:
        raise ValueError("no header of a PLY file")
    lines = [line.split() for line in data[: end.start()].decode("latin-1").splitlines()]
    formats = [line[1] for line in lines if line[:1] == ["format"] and len(line) > 1]
    if len(formats) != 1 or formats[0] not in ORDERS:
        raise ValueError("no format of a PLY file")
    return lines, formats[0], end.end()


def ply_comments(lines: list[list[str]]) -> tuple[str, ...]:
    """The lines of a header that are comments or information about the object."""
    return tuple(" ".join(line) for line in lines if line[:1] in (["comment"], ["obj_info"]))


def ply_elements(lines: list[list[str]]) -> list[PlyElement]:
    """The elements that have properties. Raises: ValueError, KeyError: lines that are no header's."""
    made: dict[str, PlyElement] = {}
    last = PlyElement("", 0)
    for words in lines:
        match words:
            case ["element", name, count]:
                last = PlyElement(name, int(count))
                if made.setdefault(name, last) is not last or last.count < 0:
                    raise ValueError(f"element {name} twice, or of a negative count")
                continue
            case ["property", "list", counted, kind, name]:
                types = _TYPES[kind], _TYPES[counted]
            case ["property", kind, name]:
                types = _TYPES[kind], ""
            case ["element" | "property", *_]:
                raise ValueError("the line " + " ".join(words))
            case _:
                continue
        if last.properties.setdefault(name, types) is not types:
            raise ValueError(f"property {name} twice")
    return [element for element in made.values() if element.properties]


def _rows(data: bytes, start: int, order: str, element: PlyElement, source: str) -> tuple[Columns, Lists, int]:
    """The values of an element's rows by property, and where they end.

    Raises:
        MeshError: the file ends before that.
    """
    if not element.count:
        return {}, {}, start
    try:
        first = _walk(data, start, order, element, 1)[1]
        lengths = {label: sizes[0] for label, (_, sizes) in first.items()}
        row = np.dtype(
            [
                part
                for label, (kind, counted) in element.properties.items()
                for part in row_fields(label, order + kind, order + counted, lengths.get(label))
            ]
        )
        if start + element.count * row.itemsize <= len(data):
            rows = np.frombuffer(data, row, element.count, start)
            if all((rows[COUNT + label] == length).all() for label, length in lengths.items()):
                lists = {label: (rows[label].ravel(), np.full(len(rows), size)) for label, size in lengths.items()}
                columns = {label: rows[label] for label in element.properties if label not in lengths}
                return columns, lists, start + rows.nbytes
        return _walk(data, start, order, element, element.count)
    except struct.error:
        raise MeshError(source, f"element {element.name}", f"{element.count} rows", "an end before that") from None


def row_fields(label: str, kind: str, counted: str, length: int | None) -> list[tuple[Any, ...]]:
    """NumPy's fields of a property, of a list if `length` is how many values it has in every row."""
    return [(label, kind)] if length is None else [(COUNT + label, counted), (label, kind, (length,))]


def _walk(data: bytes, start: int, order: str, element: PlyElement, count: int) -> tuple[Columns, Lists, int]:
    """As `_rows`, row by row, whatever the lengths of the lists.

    Raises:
        struct.error: the data ends before that.
    """
    plan = [
        (struct.Struct(order + (counted or kind)), order + "{}" + kind if counted else "", array(kind), array("q"))
        for kind, counted in element.properties.values()
    ]
    for _ in range(count):
        for first, items, values, sizes in plan:
            (value,) = first.unpack_from(data, start)
            start += first.size
            if items:
                size = int(value)
                if size != value or size < 0:
                    raise ValueError(f"a list of {value} values")
                values.extend(struct.unpack_from(items.format(size), data, start))
                sizes.append(size)
                start += size * values.itemsize
            else:
                values.append(value)
    columns: Columns = {}
    lists: Lists = {}
    for label, (_, items, values, sizes) in zip(element.properties, plan, strict=True):
        if items:
            lists[label] = np.array(values), np.array(sizes)
        else:
            columns[label] = np.array(values)
    return columns, lists, start


def _whole(numbers: npt.NDArray[Any]) -> Int64s:
    whole = numbers.astype(np.int64)
    if not (whole == numbers).all():
        raise ValueError("vertex indices that are no whole numbers")
    return whole
