"""OFF, text: vertices, then polygons (Geomview manual, "OFF Files": OFF, COFF, NOFF, STOFF and their combinations).

An own reader because the variants' extra columns must not pass for coordinates, counts are not to be trusted, and
concave polygons and the order of vertices are kept, all in bounded memory (docs/reliability.md).
"""

import re

from raytrace.errors import MeshError

from ...geometry.instances import Instance
from ...geometry.polygons import triangulate
from ..number_rows import NumberRows, whole
from ..table import MeshInput

_HEADER = re.compile(rb"(?:\s|#[^\n\r]*+)*+((?:ST)?C?N?)OFF\b(?!\s+BINARY)")


def read_off(given: MeshInput) -> list[Instance]:
    """The triangles, with normals of the variant N; no colours. Raises: MeshError, ValueError: it is malformed."""
    source = given.source
    data = given.file.read()
    match = _HEADER.match(data)
    if not match:
        raise MeshError(source, "content", "an OFF file of text with three coordinates a vertex", "another header")
    rows = NumberRows.of(data, match.end())
    fault = MeshError(source, "content", "a number of vertices and one of faces", "fewer numbers")
    head = whole(rows.take(rows.bounds[:2][:-1], rows.bounds[1:2], 2, fault))
    vertex_count, face_count = [*head.tolist(), 0, 0][:2]
    if vertex_count < 1 or face_count < 0:
        raise MeshError(source, "content", "a number of vertices and one of faces", f"{vertex_count} and {face_count}")
    expected = f"{vertex_count} vertices and {face_count} faces"
    begins, ends = (bounds[1 : 1 + vertex_count + face_count] for bounds in (rows.bounds[:-1], rows.bounds[1:]))
    if len(begins) < vertex_count + face_count:
        raise MeshError(source, "content", expected, "an end before that")
    fault = MeshError(source, "content", expected, "lines of fewer numbers")
    width = 6 if b"N" in match[1] else 3
    places = rows.take(begins[:vertex_count], ends[:vertex_count], width, fault).reshape(-1, width)
    begins = begins[vertex_count:]
    ends = ends[vertex_count:]
    sizes, values = rows.take_lists(begins, ends, fault)
    corners = whole(values)
    triangles = triangulate(places[:, :3], corners, sizes, source)
    normals = places[:, 3:] if width == 6 else None
    unread = ("colours",) if b"C" in match[1] or (ends - begins > sizes + 1).any() else ()
    filled = triangles.take(corners)
    polygons = triangles.polygons
    return [
        Instance(given.name, places[:, :3], filled, normals, None, triangles.notes, None, unread, polygons=polygons)
    ]
