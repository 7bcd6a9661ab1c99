"""Texture coordinates and colours of an OBJ's or PLY's vertices, for pictures.

Neither format says how colours are encoded. They are taken as sRGB, as most programs write and show them. The grey that
a bake has given a PLY shows w, and is no colour.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from raytrace.errors import printable
from raytrace.image.srgb import decode_srgb
from raytrace.types import Float64s

from ..formats.load import read_objects
from ..geometry.corners import split_corners
from ..geometry.instances import flatten
from ..geometry.primitives import Origin, TexturedMesh

_BEGIN = 1 << 16  # bytes of a file that show whether it can have colours


def read_textured(path: Path) -> tuple[TexturedMesh, list[str]]:
    """An OBJ or PLY file with its texture coordinates if all corners have some; and warnings.

    Every combination of a vertex with a texture coordinate, and with a normal, becomes a vertex, after the file's own.
    """
    (instance,), _ = read_objects(path, keep=True, alpha=True)
    mesh, _ = flatten([instance], str(path))
    notes = [printable(f"{path}: {note}") for note in instance.notes]
    attributes = instance.attributes
    uv = attributes.uv if attributes else None
    if attributes is None or uv is None or np.isnan(uv.rows[uv.of]).any():
        return TexturedMesh(mesh), notes
    split_by = [values for values in (uv, attributes.normals) if values]
    places = attributes.triangles.take(np.arange(len(attributes.corners)))
    vertices, faces, like = split_corners(attributes.corners, places, split_by, len(mesh.vertices))
    normals = None if mesh.normals is None else mesh.normals[vertices]
    if attributes.normals:
        normals = attributes.normals.rows[attributes.normals.of[like]]
    split = replace(mesh, vertices=mesh.vertices[vertices], faces=faces, normals=normals)
    return TexturedMesh(split, uv.rows[uv.of[like]], Origin(vertices, len(mesh.vertices))), notes


def vertex_colors(path: Path) -> tuple[Float64s | None, list[str]]:
    """Linear RGB (n, 3) of the vertices in the file's order, None if they have none, and warnings."""
    with path.open("rb") as file:
        coloured = False
        if path.suffix.lower() == ".ply":
            coloured = b" red\n" in file.read(_BEGIN).partition(b"end_header")[0].replace(b"\r", b"")
        elif path.suffix.lower() == ".obj":  # whose first vertex then has six numbers
            first = next((line for line in file if line.startswith((b"v ", b"v\t"))), b"")
            coloured = len(first.partition(b"#")[0].split()) >= 7
    if not coloured:
        return None, []
    (instance, *_), _ = read_objects(path, keep=True)
    notes = [printable(f"{path}: left out: {words}") for words in instance.unread if words.startswith("colours")]
    colors = instance.attributes.colors if instance.attributes else None
    return None if colors is None else decode_srgb(colors[:, :3].clip(0, 1)).astype(float), notes
