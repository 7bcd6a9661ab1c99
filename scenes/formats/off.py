"""OFF, text: vertices, then polygons.

An own reader because the variants' extra columns must not pass for coordinates, counts are not to be trusted, and
concave polygons and the order of vertices are kept, all in bounded memory (docs/reliability.md).
Format: Geomview manual, "OFF Files", the variants OFF, COFF, NOFF, STOFF and their combinations.
"""

import re

import numpy as np

from raytrace.errors import MeshError

from ..geometry.instances import Instance
from ..geometry.polygons import triangulate
from .table import MeshInput

_HEADER = re.compile(r"\s*((?:ST)?C?N?)OFF\b(?!\s+BINARY)(.*)", re.DOTALL)


def read_off(given: MeshInput) -> list[Instance]:
    """The vertices and triangles of an OFF file, with its normals if it is of the variant N. Colours are not read.

    Raises:
        MeshError: it is no OFF file, or ends early.
        ValueError: anything else that is malformed.
    """
    source = given.source
    match = _HEADER.match(re.sub(r"#[^\n\r]*", "", given.file.read().decode("utf-8", "replace")))
    if not match:
        raise MeshError(source, "content", "an OFF file of text with three coordinates a vertex", "another header")
    rows = [row for row in match[2].splitlines() if row and not row.isspace()]
    vertex_count, face_count = (int(word) for word in rows[0].split()[:2]) if rows else (0, 0)
    if vertex_count < 1 or face_count < 0:
        raise MeshError(source, "content", "a number of vertices and one of faces", f"{vertex_count} and {face_count}")
    faces = [row.split() for row in rows[1 + vertex_count : 1 + vertex_count + face_count]]
    if len(faces) < face_count or (faces and len(faces[-1]) <= int(faces[-1][0])):
        raise MeshError(source, "content", f"{vertex_count} vertices and {face_count} faces", "an end before that")
    width = 6 if "N" in match[1] else 3
    numbers = " ".join(" ".join(row.split()[:width]) for row in rows[1 : 1 + vertex_count])
    places = np.fromstring(numbers, sep=" ").reshape(vertex_count, width)
    sizes = np.array([int(face[0]) for face in faces], np.int64)
    corners = np.array(
        [int(word) for face, size in zip(faces, sizes, strict=True) for word in face[1 : size + 1]], np.int64
    )
    if (sizes < 0).any():
        raise ValueError("a face of fewer than no corners")
    triangles = triangulate(places[:, :3], corners, sizes, source)
    normals = places[:, 3:] if width == 6 else None
    unread = ("colours",) if "C" in match[1] or any(len(f) > s + 1 for f, s in zip(faces, sizes, strict=True)) else ()
    filled, polygons = triangles.take(corners), triangles.polygons
    return [
        Instance(given.name, places[:, :3], filled, normals, None, triangles.notes, None, unread, polygons=polygons)
    ]
