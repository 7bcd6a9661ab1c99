"""PLY, text and binary.

An own reader, beside trimesh's and plyfile, because properties, polygons and the order of vertices are kept for the
output, and memory stays bounded: 7.5 times the bytes of a file, where trimesh takes 22 times (evidence/reliability.md).
Format: Greg Turk, The PLY polygon file format, 1994. No count is trusted: rows are looked for in the bytes.
"""

import struct
from array import array
from dataclasses import replace

import numpy as np

from raytrace.errors import MeshError
from raytrace.types import Int64s

from ...geometry.attributes import Element, Property
from ...geometry.instances import Instance
from ...geometry.polygons import triangulate
from ..number_rows import NumberRows, whole
from ..table import MeshInput
from .layout import COUNT, INDICES, PlyElement, PlyHeader, columns_of, ply_attributes, read_header

_NORMAL = ("nx", "ny", "nz")


def read_ply(given: MeshInput) -> list[Instance]:
    """The vertices and triangles, with normals if there are `nx ny nz`; with `given.keep` all elements.

    Raises: MeshError: the file ends early, or has no vertices. ValueError, KeyError: anything else that is not PLY.
    """
    data = given.file.read()
    source = given.source
    header = read_header(data)
    elements = _read_text(data, header, source) if header.text else _read_elements(data, header, source)
    if not any(element.count for element in elements if element.name == "vertex"):
        raise MeshError(source, "elements", "one of vertices", "none")
    vertex = {name: column.values for name, column in columns_of(elements, "vertex").items() if column.sizes is None}
    vertices = np.stack([vertex[axis] for axis in "xyz"], axis=1)
    normals = np.stack([vertex[axis] for axis in _NORMAL], axis=1) if set(_NORMAL) <= set(vertex) else None
    corners = np.empty(0, np.int64)
    sizes = np.empty(0, np.int64)
    for column in filter(None, map(columns_of(elements, "face").get, INDICES[::-1])):
        if column.sizes is not None:
            corners = whole(column.values)
            sizes = column.sizes
    triangles = triangulate(vertices, corners, sizes, source)
    made = Instance(given.name, vertices, triangles.take(corners), normals, notes=triangles.notes, up=header.up)
    if given.keep:
        kept = list(map(_declared, elements, header.elements)) if header.text else elements
        folder = given.path.parent
        attributes = ply_attributes(tuple(kept), header.comments, corners, sizes, triangles, folder)
        made = made._replace(attributes=attributes)
    w = vertex.get("obscurance")
    profile = header.profile(vertex)
    return [made._replace(w=w, profile=profile, polygons=triangles.polygons)]


def _read_text(data: bytes, header: PlyHeader, source: str) -> list[Element]:
    """All elements of a text file as doubles. Raises: MeshError, ValueError: rows that are no lines, or others."""
    fault = MeshError(source, "rows", "one line for each, with as many numbers as the header says", "others")
    if data.find(b"#", header.start) >= 0:
        raise fault
    lines = NumberRows.of(data, header.start)
    first_line = 0
    made = []
    for element in header.elements:
        at = lines.bounds[:-1][first_line : first_line + element.count]
        ends = lines.bounds[1:][first_line : first_line + element.count]
        left = lines.bounds[-1] - lines.bounds[first_line]
        if len(at) < element.count or left < element.count * len(element.properties):
            raise _ends_early(source, element)
        if not any(counted for _, counted in element.properties.values()):
            _check_counts(source, element, ends - at)
        columns = []
        for name, (_, counted) in element.properties.items():
            sizes, values = lines.take_lists(at, ends, fault) if counted else (None, lines.take(at, ends, 1, fault))
            columns.append(Property(name, "d", values, "d" if counted else "", sizes))
            at = at + 1 + (0 if sizes is None else sizes)
        if not np.array_equal(at, ends):
            raise fault
        made.append(Element(element.name, element.count, tuple(columns)))
        first_line += element.count
    if first_line + 1 < len(lines.bounds):
        raise fault
    return made


def _check_counts(source: str, element: PlyElement, counts: Int64s) -> None:
    """Raises: MeshError: a row has not one number for each property. Args: counts: of the numbers in each row."""
    wanted = len(element.properties)
    if (counts != wanted).any():
        row = int(np.argmax(counts != wanted))
        raise MeshError(source, f"element {element.name}, row {row}", f"{wanted} numbers", int(counts[row]))


def _ends_early(source: str, element: PlyElement) -> MeshError:
    return MeshError(source, f"element {element.name}", f"{element.count} rows", "an end before that")


def _declared(element: Element, declared: PlyElement) -> Element:
    """An element of a text file in its declared types; float is double where it would overflow, or move vertices."""
    single = {column.name: column.values for column in element.properties if column.sizes is None}
    far = False
    made = []
    if element.count and {*"xyz"} <= set(single):
        # Where float32 moves vertices by more than its error of an extent about 0.
        vertices = np.stack([single[axis] for axis in "xyz"], axis=1)
        far = not np.abs(vertices.astype("f") - vertices).max() <= 1e-6 * np.ptp(vertices, axis=0).max()
    for column in element.properties:
        kind, counted = declared.properties[column.name]
        values = column.values
        if kind == "f":
            is_vertex = column.name in {*"xyz"}
            overflows = np.isinf(values.astype("f")) & np.isfinite(values)
            kind = "d" if (far and is_vertex) or overflows.any() else "f"
            values = values.astype(kind)
        made.append(Property(column.name, kind, values, counted, column.sizes))
    return replace(element, properties=tuple(made))


def _read_elements(data: bytes, header: PlyHeader, source: str) -> list[Element]:
    """All elements. Raises: MeshError: the file ends before them."""
    made = []
    start = header.start
    for element in header.elements:
        try:
            columns, start = _read_rows(data, start, header.order, element)
        except struct.error:
            raise _ends_early(source, element) from None
        made.append(Element(element.name, element.count, tuple(columns)))
    return made


def _read_rows(data: bytes, start: int, order: str, element: PlyElement) -> tuple[list[Property], int]:
    """The columns of an element, and where its rows end: together where all are as long as the first."""
    first, _ = _walk(data, start, order, element, min(element.count, 1))
    lengths = {column.name: int(column.sizes.sum()) for column in first if column.sizes is not None}
    row = element.row(lengths, order)
    fits = start + element.count * row.itemsize <= len(data)
    table = np.frombuffer(data, row, element.count if fits else 0, start)
    if not fits or any((table[COUNT + name] != length).any() for name, length in lengths.items()):
        return _walk(data, start, order, element, element.count)
    made = []
    for name, (kind, counted) in element.properties.items():
        sizes = np.full(len(table), lengths[name]) if counted else None
        made.append(Property(name, kind, table[name].ravel() if counted else table[name], counted, sizes))
    return made, start + table.nbytes


def _walk(data: bytes, start: int, order: str, element: PlyElement, count: int) -> tuple[list[Property], int]:
    """As `_read_rows`, row by row, whatever the lengths of the lists."""
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
    made = []
    for (name, (kind, counted)), (_, _, values, sizes) in zip(element.properties.items(), plan, strict=True):
        made.append(Property(name, kind, np.array(values), counted, np.array(sizes) if counted else None))
    return made, start
