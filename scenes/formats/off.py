"""OFF, text: vertices, then polygons (Geomview manual, "OFF Files": OFF, COFF, NOFF, STOFF and their combinations).

An own reader because the variants' extra columns must not pass for coordinates, counts are not to be trusted, and
concave polygons and the order of vertices are kept, all in bounded memory (evidence/reliability.md).
"""

import re
from contextlib import suppress

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.types import Float64s

from ..asset.asset import Asset
from ..asset.primitive import COLOR, NORMAL, Column, ColumnSet, Primitive
from .number_rows import NumberRows, whole
from .table import MeshInput

_HEADER = re.compile(rb"(?:\s|#[^\n\r]*+)*+((?:ST)?C?N?)OFF\b(?!\s+BINARY)")


def read_off(mesh_input: MeshInput) -> Asset:
    """The polygons, with normals of the variant N, colours of C and texture coordinates of ST at the vertices; no
    colours of faces. Raises: MeshError, ValueError: it is malformed."""
    source = mesh_input.source
    data = mesh_input.file.read()
    header = _HEADER.match(data)
    if not header:
        raise MeshError(source, "content", "an OFF file of text with three coordinates a vertex", "another header")
    lines = NumberRows.of(data, header.end())
    # The first row: numbers of vertices and of faces.
    expected = "a number of vertices and one of faces"
    fault = MeshError(source, "content", expected, "fewer numbers")
    counts = whole(lines.take(slice(1), 0, 2, fault))
    vertex_count, face_count = [*counts.tolist(), 0, 0][:2]
    if vertex_count < 1 or face_count < 0:
        raise MeshError(source, "content", expected, f"{vertex_count} and {face_count}")
    # A row for each vertex, then one for each face.
    expected = f"{vertex_count} vertices and {face_count} faces"
    of_vertices = slice(1, 1 + vertex_count)
    of_faces = slice(1 + vertex_count, 1 + vertex_count + face_count)
    if len(lines.lengths) < of_faces.stop:
        raise MeshError(source, "content", expected, "an end before that")
    fault = MeshError(source, "content", expected, "lines of fewer numbers")
    has_normals = b"N" in header[1]
    width = 6 if has_normals else 3
    vertex_rows = lines.take(of_vertices, 0, width, fault).reshape(-1, width)
    sizes, values = lines.take_lists(of_faces, 0, fault)
    corners = whole(values)
    columns = {NORMAL: Column(vertex_rows[:, 3:])} if has_normals else {}
    with suppress(ValueError):  # words that are no numbers are none of these
        columns |= _further_columns(lines, of_vertices, width, header[1])
    primitive = Primitive.of(vertex_rows[:, :3], corners, sizes, source, columns=ColumnSet(columns))
    kept = COLOR in columns or b"C" not in header[1]
    has_others = bool((lines.lengths[of_faces] > sizes + 1).any())
    unread = ("colours",) if not kept or has_others else ()
    return Asset.single(mesh_input.path, mesh_input.name, primitive, unread=unread)


def _further_columns(lines: NumberRows, rows: slice, width: int, variant: bytes) -> dict[str, Column]:
    """Colours, and texture coordinates behind them, where all vertices have as many numbers. Args: width: of the
    coordinates and normals before. Raises: ValueError: text that is not numbers."""
    length = lines.lengths[rows]
    further = int(length[0]) - width
    if further <= 0 or (length != length[0]).any():
        return {}
    values = lines.take(rows, width, further, ValueError()).reshape(-1, further)
    columns = {}
    if b"ST" in variant and further >= 2:
        columns["uv0"] = Column(values[:, -2:])
        values = values[:, :-2]
    if b"C" in variant and (colours := _colours(values)):
        columns[COLOR] = colours
    return columns


def _colours(values: Float64s) -> Column | None:
    """Colours (n, 3), or (n, 4) with alpha, of numbers up to 1, or else up to 255; None of others."""
    largest = 255.0 if values.max(initial=0.0) > 1 else 1.0
    if values.shape[1] not in (3, 4) or not ((values >= 0) & (values <= largest)).all():
        return None
    return Column(values / largest, srgb=True)


FORMATS = (
    {
        "ending": ".off",
        "name": "OFF",
        "read": "obscurance.scenes.formats.off:read_off",
        "peak": 7.5,
        "begins": rb"\s*(ST)?(C?N?4?n?)OFF\b",
    },
)
