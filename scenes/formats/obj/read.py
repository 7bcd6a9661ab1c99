"""Wavefront OBJ: geometry over exactly the file's own `v` lines.

trimesh's reader splits, repeats or drops vertices, takes index 0 for 1 and wraps negative ones. Memory is estimated at
9 times the bytes of a file, where what trimesh reads takes 22 times (docs/reliability.md).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from raytrace.errors import MeshError
from raytrace.types import Float64s

from ...geometry.corners import unique_rows
from ...geometry.instances import Instance
from ...geometry.polygons import triangulate
from ...geometry.primitives import Origin
from ..table import MeshInput
from .attributes import obj_attributes, obj_opacity
from .text import ObjText


def read_obj(given: MeshInput) -> list[Instance]:
    """All faces of the file, in its order, as triangles of one instance: no vertices are divided in OBJ.

    Normals are taken where every face has them and each vertex has only one. Raises: as `ObjText`.
    """
    folder = given.path.parent
    file = ObjText(given.file.read(), given.source)
    normals = file.normals()
    vertex_normals = normals and normals.at_vertices(file.corners, len(file.vertices), np.nan)
    triangles = triangulate(file.vertices, file.corners, file.sizes, given.source)
    notes = file.notes + triangles.notes
    made = Instance(given.name, file.vertices, triangles.take(file.corners), vertex_normals, notes=notes)
    if given.keep:
        attributes, unread = obj_attributes(file, folder, triangles, normals, vertex_normals is not None)
        made = replace(made, attributes=attributes, unread=unread)
    if given.alpha:
        opacity, of_alpha = obj_opacity(file, folder, triangles)
        unread = tuple(words for words in made.unread if not any(note.startswith(words) for note in of_alpha))
        made = replace(made, opacity=opacity, unread=unread, notes=notes + of_alpha)
    return [replace(made, polygons=triangles.polygons)]


def read_textured_obj(data: bytes, name: str, source: str, folder: Path) -> tuple[Instance, Float64s, Origin]:
    """All faces of the file with texture coordinates uv (n, 2), v upwards, and which vertices of the file they have.

    Every combination of a vertex with a texture coordinate, and with a normal where every face has them, becomes a
    vertex of its own, so that seams and hard edges stay. Faces have the alpha of their materials.

    Raises: MeshError, ValueError: as `ObjText`, or a corner without texture coordinates.
    """
    file = ObjText(data, source)
    normals = file.normals()
    uv = file.uv()
    if uv is None or not file.some("vt").all():
        raise MeshError(source, "vt", "texture coordinates on every corner of a face", "none on some")
    columns = [file.corners, uv.of, *([normals.of] if normals else [])]
    first, corners = unique_rows(columns)
    kinds = np.stack(columns, axis=1)[first]
    triangles = triangulate(file.vertices, file.corners, file.sizes, source)
    own = normals.rows[kinds[:, 2]] if normals else None
    faces = triangles.take(corners)
    opacity, notes = obj_opacity(file, folder, triangles)
    notes = file.notes + triangles.notes + notes
    vertices = file.vertices[kinds[:, 0]]
    made = Instance(name, vertices, faces, own, notes=notes, opacity=opacity, polygons=triangles.polygons)
    return made, uv.rows[kinds[:, 1]], Origin(kinds[:, 0], len(file.vertices))
