"""A mesh file but glTF for pictures, with texture coordinates and colours of its vertices.

Neither OBJ nor PLY says how colours are encoded. They are taken as sRGB, as most programs write and show them. The grey
that a bake has given a PLY shows w, and is no colour.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from obscurance.raytrace.errors import printable
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.raytrace.mesh.corners import split_creases
from obscurance.raytrace.types import Float64s

from ..formats.load import load
from ..geometry.attributes import SourceAttributes
from ..geometry.primitives import Origin, TexturedMesh

_COLOURS = "colours", "texture of map_Kd", "texture of diffuse"  # how words on what is left out begin


def read_mesh(path: Path, textured: bool, own_normals: bool = True) -> tuple[TexturedMesh, list[str]]:
    """The mesh of a file, with texture coordinates if it is to be `textured` and all corners have some; and warnings.

    Every combination of a vertex with a normal (`raytrace.mesh.normals.corner_normals`), and with a texture coordinate,
    becomes a vertex, after the file's own. Args: own_normals: whether the file's are asked for.
    """
    file = load(path, names=True)
    notes = [*file.notes, *colours_left_out(path, file.unread)]
    attributes = file.held
    colours = linear_colours(attributes)
    uv = attributes.uv
    several = []
    if textured and uv is not None and not np.isnan(uv.values[uv.of]).any():
        several = [attributes.of_triangles(uv)]
    split = split_creases(file.mesh, several, own_normals)
    origin = Origin(split.vertices, len(file.mesh.vertices))
    of_corners = several[0].values[several[0].of[split.like]] if several else None
    return TexturedMesh(split.mesh, of_corners, origin, None if colours is None else colours[split.vertices]), notes


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
