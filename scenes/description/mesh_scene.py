"""Mesh files but glTF as scenes and in scenes, with their materials, texture coordinates and colours of vertices.

A file alone is a scene of an object for each of its materials, framed whole, under three lights. Kd and Ks of an OBJ's
materials are the reflectances of Blinn–Phong, Ns is its exponent (Wavefront MTL 5.0, illum 2); divided by π, as
Lambert's is, for lights in physical units.

Neither OBJ nor PLY says how colours are encoded. They are taken as sRGB, as most programs write and show them. The grey
that a bake has given a PLY shows w, and is no colour.
"""

from collections.abc import Iterable, Iterator
from math import pi
from pathlib import Path

import numpy as np

from obscurance.raytrace import BlinnPhong, Lambert, Material, Object, Scene, Settings, Shape
from obscurance.raytrace.errors import printable
from obscurance.raytrace.mesh.corners import split_creases
from obscurance.raytrace.mesh.warnings import lying_notes
from obscurance.raytrace.types import Float64s

from ..asset import material as stored
from ..asset.asset import Asset
from ..formats.load import load
from ..formats.objects import ObjectSelection
from ..formats.table import is_raster
from ..geometry.primitives import Origin, TexturedMesh
from .description import BACKGROUND, NEUTRAL, WHITE, SceneDescription, framing, sun_and_sky, three_lights

_COLOURS = "colours", "texture of map_Kd", "texture of diffuse"  # how words on what is left out begin


def mesh_scene(source: Asset, settings: Settings, up: str | None = None, view: str | None = None) -> SceneDescription:
    """The scene of a mesh, in its materials, the colours of its vertices, or grey. Args: up, view: as `framing`."""
    shapes = list(_shapes(source))
    objects = tuple(Object(shape, name=source.path.stem) for shape, _ in shapes)
    camera = framing(source.mesh, up, settings.width, settings.height, view)
    is_terrain = is_raster(source.path)
    lit = Scene(objects, sun_and_sky() if is_terrain else three_lights(camera), BACKGROUND)
    notes = (*source.notes, *colours_left_out(source.path, source.unread), *lying_notes(source.mesh, up))
    origins = tuple(origin for _, origin in shapes)
    return SceneDescription(
        lit, camera, settings, files=source.files, notes=notes, origins=origins, lit_from_camera=not is_terrain,
        is_framed=True,
    )  # fmt: skip


def reflection(material: stored.Material) -> Material:
    """A material of a mesh file as a reflection model."""
    if not any(material.specular) or not material.exponent:
        return Lambert(albedo=material.colour, emission=material.emission)
    diffuse = np.divide(material.colour, pi)
    specular = np.divide(material.specular, pi)
    return BlinnPhong(
        k_d=diffuse, k_s=specular, k_a=material.colour, exponent=material.exponent, emission=material.emission
    )


def _shapes(source: Asset) -> Iterator[tuple[Shape, Origin | None]]:
    """The shapes of a mesh file, one for the faces of each material, and their origins in the file.

    Vertices are repeated at creases and where texture coordinates jump.
    """
    mesh = source.mesh
    total = len(mesh.vertices)
    colours = linear_colours(source)
    uv = source.per_corner("uv0") if any(material.texture for material in source.materials) else None
    several = [uv] if uv else []

    # Vertices with one normal and one place in the texture each.
    mesh, _, of, corner_like = split_creases(mesh, several)
    origin = Origin(of, total)
    if colours is not None:
        colours = colours[of]
    bare = NEUTRAL if colours is None else WHITE
    if not source.materials:
        yield Shape(mesh, bare, colours=colours), origin
        return

    # The faces of each material, those without texture coordinates apart.
    material_of = np.concatenate([part.primitive.of_faces(part.primitive.material) for part in source.parts])
    at_vertices = uv.values[uv.of[corner_like]] if uv else np.full((len(mesh.vertices), 2), np.nan)
    has_uv = ~np.isnan(at_vertices[mesh.faces]).any(axis=(1, 2))
    group = 2 * material_of + has_uv
    parts = ObjectSelection(mesh, np.ones(len(group), np.bool_), group).parts()
    for number, (vertices, _, part) in zip(np.unique(group), parts, strict=True):
        material = source.materials[number // 2] if number >= 0 else None
        texture = material.texture.texture if material and material.texture and number % 2 else None
        own_uv = at_vertices[vertices] if texture else None
        own_colours = None if colours is None else colours[vertices]
        shape = Shape(part, reflection(material) if material else bare, own_uv, texture, colours=own_colours)
        yield shape, Origin(of[vertices], total)
        total = 0  # of further parts of the file


def read_mesh(path: Path, textured: bool, own_normals: bool = True) -> tuple[TexturedMesh, list[str]]:
    """The mesh of a file, with texture coordinates if it is to be `textured` and all corners have some; and warnings.

    Every combination of a vertex with a normal (`raytrace.mesh.normals.corner_normals`), and with a texture coordinate,
    becomes a vertex, after the file's own. Args: own_normals: whether the file's are asked for.
    """
    file = load(path, names=True)
    notes = [*file.notes, *colours_left_out(path, file.unread)]
    colours = linear_colours(file)
    uv = file.per_corner("uv0") if textured else None
    several = [uv] if uv and not np.isnan(uv.values[uv.of]).any() else []
    split = split_creases(file.mesh, several, own_normals)
    origin = Origin(split.vertices, len(file.mesh.vertices))
    of_corners = several[0].values[several[0].of[split.like]] if several else None
    return TexturedMesh(split.mesh, of_corners, origin, None if colours is None else colours[split.vertices]), notes


def linear_colours(source: Asset) -> Float64s | None:
    """Linear RGB (n, 3) of the vertices in the file's order, None if they have none."""
    colours = source.colours()
    return None if colours is None else colours[:, :3].clip(0.0, 1.0)


def colours_left_out(path: Path, unread: Iterable[str]) -> list[str]:
    """Warnings about colours and pictures among the parts of a file that are not read, `unread`."""
    pictures = "; of pictures are read PNG and JPEG, in the mesh's folder or below"
    ends = {words: pictures if words.startswith("texture") else "" for words in unread if words.startswith(_COLOURS)}
    return [printable(f"{path}: left out: {words}{end}") for words, end in ends.items()]
