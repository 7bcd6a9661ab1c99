"""PLY, text and binary.

An own reader, beside trimesh's and plyfile, because properties, polygons and the order of vertices are kept for the
output, and memory stays bounded: 7.5 times the bytes of a file, where trimesh takes 22 times (evidence/reliability.md).
Format: Greg Turk, The PLY polygon file format, 1994. No count is trusted: rows are looked for in the bytes.
"""

import struct
from array import array
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import MeshError

from ...asset.asset import Asset
from ...asset.primitive import NORMAL, Column, Primitive, W
from ...geometry.polygons import strip_triangles
from ..number_rows import NumberRows, whole
from ..table import MeshInput
from .layout import (
    COUNT,
    INDICES,
    Element,
    Ply,
    PlyHeader,
    Property,
    columns_of,
    ply_columns,
    ply_materials,
    read_header,
    row_of,
)

_NORMAL = ("nx", "ny", "nz")


def read_ply(mesh_input: MeshInput) -> Asset:
    """The vertices and polygons, with all elements; `tristrips` of a file without faces become faces.

    Raises: MeshError: the file ends early, or has no vertices. ValueError, KeyError: anything else that is not PLY.
    """
    data = mesh_input.file.read()
    source = mesh_input.source
    header = read_header(data)
    elements = _read_text(data, header, source) if header.text else _read_binary(data, header, source)
    if "face" not in [element.name for element in elements]:
        elements = [_cut(element) if element.name == "tristrips" else element for element in elements]
    if not any(element.count for element in elements if element.name == "vertex"):
        raise MeshError(source, "elements", "one of vertices", "none")
    vertex = {name: column.values for name, column in columns_of(elements, "vertex").items()}
    # Faces: of both usual names of their list of vertices, the first that the file has.
    corners: npt.NDArray[Any] = np.empty(0, np.int64)
    sizes: npt.NDArray[Any] = corners
    for column in filter(None, map(columns_of(elements, "face", lists=True).get, INDICES[::-1])):
        corners, sizes = column.values, column.sizes
    if corners.dtype.kind not in "iu":  # of text
        corners = whole(corners)
    # What is kept, of text in the types that the file declares; normals and w have all digits.
    stored = list(map(_declared, elements)) if header.text else elements
    columns = ply_columns(stored, sizes)
    if set(_NORMAL) <= set(vertex):
        columns |= {NORMAL: Column(np.stack([vertex[axis] for axis in _NORMAL], axis=1))}
    if W in vertex:
        columns |= {W: Column(vertex[W])}
    positions = np.stack([vertex[axis] for axis in "xyz"], axis=1)
    primitive = Primitive.of(positions, corners, sizes, source, columns=columns, profile=header.profile(vertex))
    materials = ply_materials(header.comments, mesh_input.path.parent) if "uv0" in columns else ()
    if materials:
        face = columns_of(elements, "face")
        number = face["texnumber"].values if "texnumber" in face else np.zeros(len(sizes))
        material_of = np.where((number >= 0) & (number < len(materials)), number, -1).astype(np.int64)
        primitive = primitive._replace(material=material_of)
    pictures = tuple(path for material in materials for path in material.pictures)
    raw = Ply(stored, header.comments)
    return Asset.single(
        mesh_input.path, mesh_input.name, primitive, materials=materials, up=header.up, pictures=pictures, raw=raw
    )  # fmt: skip


def _cut(strips: Element) -> Element:
    """A face for each triangle of lists of vertices, strips that −1 parts, as Stanford's files have them."""
    (column,) = (column for column in strips.properties if column.counted)
    corners = strip_triangles(whole(column.values), column.sizes)
    faces = Property(INDICES[0], "i", corners.ravel(), "B", np.full(len(corners), 3))
    return Element("face", len(corners), (faces,))


def _read_text(data: bytes, header: PlyHeader, source: str) -> list[Element]:
    """All elements of a text file, as doubles. Raises: MeshError, ValueError: rows that are no lines, or others."""
    fault = MeshError(source, "rows", "one line for each, with as many numbers as the header says", "others")
    if data.find(b"#", header.start) >= 0:
        raise fault
    lines = NumberRows.of(data, header.start)
    line_lengths = lines.lengths
    first_line = 0
    read_elements = []
    for element in header.elements:
        lines_of = slice(first_line, first_line + element.count)
        lengths = line_lengths[lines_of]
        wanted = len(element.properties)
        left = lines.bounds[-1] - lines.bounds[first_line]
        if len(lengths) < element.count or left < element.count * wanted:
            raise _ends_early(source, element)
        if (lengths != wanted).any() and not any(column.counted for column in element.properties):
            row = int(np.argmax(lengths != wanted))
            raise MeshError(source, f"element {element.name}, row {row}", f"{wanted} numbers", int(lengths[row]))
        columns = []
        used = np.zeros(element.count, np.int64)  # numbers of each row
        for column in element.properties:
            if column.counted:
                sizes, values = lines.take_lists(lines_of, used, fault)
                columns.append(column._replace(values=values, sizes=sizes))
                used += sizes
            else:
                columns.append(column._replace(values=lines.take(lines_of, used, 1, fault)))
            used += 1
        if not np.array_equal(used, lengths):
            raise fault
        read_elements.append(replace(element, properties=tuple(columns)))
        first_line += element.count
    if first_line + 1 < len(lines.bounds):
        raise fault
    return read_elements


def _ends_early(source: str, element: Element) -> MeshError:
    return MeshError(source, f"element {element.name}", f"{element.count} rows", "an end before that")


def _declared(element: Element) -> Element:
    """An element of a text file with its floats as float32, or as double where they overflow or vertices would move."""
    single = columns_of([element], element.name)
    doubles = set()
    if element.count and {*"xyz"} <= set(single):
        # Where float32 moves vertices by more than its error of an extent about 0.
        vertices = np.stack([single[axis].values for axis in "xyz"], axis=1)
        if not np.abs(vertices.astype("f") - vertices).max() <= 1e-6 * np.ptp(vertices, axis=0).max():
            doubles = {*"xyz"}
    columns = []
    for column in element.properties:
        if column.kind == "f":
            rounded = column.values.astype("f")
            overflows = (np.isinf(rounded) & np.isfinite(column.values)).any()
            is_double = overflows or column.name in doubles
            column = column._replace(kind="d") if is_double else column._replace(values=rounded)
        columns.append(column)
    return replace(element, properties=tuple(columns))


def _read_binary(data: bytes, header: PlyHeader, source: str) -> list[Element]:
    """All elements of a binary file. Raises: MeshError: the file ends before them."""
    elements = []
    start = header.start
    for element in header.elements:
        try:
            columns, start = _read_rows(data, start, header.order, element)
        except struct.error:
            raise _ends_early(source, element) from None
        elements.append(replace(element, properties=tuple(columns)))
    return elements


def _read_rows(data: bytes, start: int, order: str, element: Element) -> tuple[list[Property], int]:
    """The columns of an element, and where its rows end: together where all are as long as the first."""
    of_first_row, _ = _walk(data, start, order, element, min(element.count, 1))
    lengths = {column.name: int(column.sizes.sum()) for column in of_first_row if column.counted}
    row = row_of(element, lengths, order)
    fits = start + element.count * row.itemsize <= len(data)
    table = np.frombuffer(data, row, element.count if fits else 0, start)
    if not fits or any((table[COUNT + name] != length).any() for name, length in lengths.items()):
        return _walk(data, start, order, element, element.count)
    columns = []
    for column in element.properties:
        sizes = np.broadcast_to(np.int64(lengths.get(column.name, 0)), len(table) if column.counted else 0)
        columns.append(column._replace(values=table[column.name].reshape(-1), sizes=sizes))
    return columns, start + table.nbytes


def _walk(data: bytes, start: int, order: str, element: Element, count: int) -> tuple[list[Property], int]:
    """The columns of an element row by row, for lists of different lengths; arguments as of `_read_rows`."""
    plan = [
        (struct.Struct(order + (column.counted or column.kind)), column, array(column.kind), array("q"))
        for column in element.properties
    ]
    for _ in range(count):
        for first, column, values, sizes in plan:
            (value,) = first.unpack_from(data, start)
            start += first.size
            if column.counted:
                size = int(value)
                if size != value or size < 0:
                    raise ValueError(f"a list of {value} values")
                values.extend(struct.unpack_from(f"{order}{size}{column.kind}", data, start))
                sizes.append(size)
                start += size * values.itemsize
            else:
                values.append(value)
    return [column._replace(values=np.array(values), sizes=np.array(sizes)) for _, column, values, sizes in plan], start
