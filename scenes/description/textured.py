"""A mesh file but glTF for pictures, with texture coordinates and colours of its vertices.

Neither OBJ nor PLY says how colours are encoded. They are taken as sRGB, as most programs write and show them. The grey
that a bake has given a PLY shows w, and is no colour.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from raytrace.errors import printable
from raytrace.image.srgb import decode_srgb
from raytrace.types import Float64s

from ..formats.load import load
from ..geometry.attributes import SourceAttributes
from ..geometry.corners import split_corners
from ..geometry.primitives import Origin, TexturedMesh

_COLOURS = "colours", "texture of map_Kd", "texture of diffuse"  # how words on what is left out begin


def read_mesh(path: Path, textured: bool) -> tuple[TexturedMesh, list[str]]:
    """The mesh of a file, with texture coordinates if it is to be `textured` and all corners have some; and warnings.

    Every combination of a vertex with a texture coordinate, and with a normal, becomes a vertex, after the file's own.
    """
    file = load(path, names=True)
    mesh = file.mesh
    notes = [*file.notes, *colours_left_out(path, file.unread)]
    attributes = file.held
    colours = linear_colours(attributes)
    uv = attributes.uv
    if not textured or uv is None or np.isnan(uv.values[uv.of]).any():
        return TexturedMesh(mesh, colours=colours), notes
    split_by = [values for values in (uv, attributes.normals) if values]
    corner_numbers = attributes.triangles.take(np.arange(len(attributes.corners)))
    vertices, faces, like = split_corners(attributes.corners, corner_numbers, split_by, len(mesh.vertices))
    normals = None if mesh.normals is None else mesh.normals[vertices]
    if attributes.normals:
        normals = attributes.normals.values[attributes.normals.of[like]]
    split = replace(mesh, vertices=mesh.vertices[vertices], faces=faces, normals=normals)
    origin = Origin(vertices, len(mesh.vertices))
    return TexturedMesh(split, uv.values[uv.of[like]], origin, None if colours is None else colours[vertices]), notes


def linear_colours(attributes: SourceAttributes) -> Float64s | None:
    """Linear RGB (n, 3) of the vertices in the file's order, None if they have none."""
    if attributes.colors is None:
        return None
    return decode_srgb(attributes.colors[:, :3].clip(0, 1)).astype(float)


def colours_left_out(path: Path, unread: Iterable[str]) -> list[str]:
    """Warnings about colours and pictures among the parts of a file that are not read, `unread`."""
    pictures = "; of pictures are read PNG and JPEG, in the mesh's folder or below"
    ends = {words: pictures if words.startswith("texture") else "" for words in unread if words.startswith(_COLOURS)}
    return [printable(f"{path}: left out: {words}{end}") for words, end in ends.items()]
