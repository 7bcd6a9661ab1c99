"""Mesh files with their texture coordinates, as geometry of scenes."""

from pathlib import Path

import numpy as np

from raytrace.errors import printable
from raytrace.mesh.mesh import Mesh

from ..formats.load import read_objects
from ..formats.obj.read import read_textured_obj
from ..geometry.detail import split_corners
from ..geometry.instances import flatten
from ..geometry.primitives import Origin, TexturedMesh


def read_textured(path: Path) -> tuple[TexturedMesh, list[str]]:
    """An OBJ or PLY file with its texture coordinates, without them if a PLY has none, and warnings.

    Vertices whose corners have several coordinates repeat.

    Raises: MeshError, and what parsers raise.
    """
    if path.suffix.lower() == ".obj":
        instance, uv, origin = read_textured_obj(path.read_bytes(), path.stem, str(path), path.parent)
        mesh, _ = flatten([instance], str(path))
        return TexturedMesh(mesh, uv, origin), [printable(f"{path}: {note}") for note in instance.notes]
    (instance,), _ = read_objects(path, keep=True)
    mesh, _ = flatten([instance], str(path))
    notes = [printable(f"{path}: {note}") for note in instance.notes]
    detail = instance.detail
    if detail is None or detail.uv is None:
        return TexturedMesh(mesh), notes
    places = detail.triangles.take(np.arange(len(detail.corners)))
    vertices, faces, like = split_corners(detail.corners, places, [detail.uv], len(mesh.vertices))
    if len(vertices) == len(mesh.vertices):
        return TexturedMesh(mesh, detail.uv.at_vertices(detail.corners, len(vertices))), notes
    normals = None if mesh.normals is None else mesh.normals[vertices]
    split = Mesh(mesh.vertices[vertices], faces, normals, source=str(path), polygons=mesh.polygons)
    return TexturedMesh(split, detail.uv.rows[detail.uv.of[like]], Origin(vertices, len(mesh.vertices))), notes
