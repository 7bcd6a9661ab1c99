"""A mesh file alone as a scene: an object for each of its materials, framed whole, under three lights.

Kd and Ks of an OBJ's materials are the reflectances of Blinn–Phong, Ns is its exponent (Wavefront MTL 5.0, illum 2);
divided by π, as Lambert's is, for lights in physical units.
"""

from collections.abc import Iterator
from math import pi

import numpy as np

from obscurance.raytrace import BlinnPhong, Lambert, Material, Object, Scene, Settings, Shape, Texture
from obscurance.raytrace.mesh.corners import split_creases
from obscurance.raytrace.mesh.warnings import lying_notes

from ..formats.load import MeshFile
from ..formats.objects import ObjectSelection
from ..geometry.attributes import SourceMaterial
from ..geometry.primitives import Origin
from .description import BACKGROUND, NEUTRAL, WHITE, SceneDescription, framing, three_lights
from .textured import colours_left_out, linear_colours


def mesh_scene(
    source: MeshFile, settings: Settings, up: str | None = None, view: str | None = None
) -> SceneDescription:
    """The scene of a mesh, in its materials, the colours of its vertices, or grey. Args: up, view: as `framing`."""
    shapes = list(_shapes(source))
    objects = tuple(Object(shape, name=source.path.stem) for shape, _ in shapes)
    camera = framing(source.mesh, up, settings.width, settings.height, view)
    lit = Scene(objects, three_lights(camera), BACKGROUND)
    notes = (*source.notes, *colours_left_out(source.path, source.unread), *lying_notes(source.mesh, up))
    origins = tuple(origin for _, origin in shapes)
    return SceneDescription(lit, camera, settings, files=source.files, notes=notes, origins=origins)


def reflection(material: SourceMaterial) -> Material:
    """A material of a mesh file as a reflection model."""
    if not any(material.specular) or not material.exponent:
        return Lambert(albedo=material.colour, emission=material.emission)
    diffuse = np.divide(material.colour, pi)
    specular = np.divide(material.specular, pi)
    return BlinnPhong(
        k_d=diffuse, k_s=specular, k_a=material.colour, exponent=material.exponent, emission=material.emission
    )


def _shapes(source: MeshFile) -> Iterator[tuple[Shape, Origin | None]]:
    """The shapes of a mesh file, one for the faces of each material, and their origins in the file.

    Vertices are repeated at creases and where texture coordinates jump.
    """
    mesh = source.mesh
    total = len(mesh.vertices)
    held = source.held
    colours = linear_colours(held)
    materials = () if held.material_of is None else held.materials
    has_textures = any(material.texture for material in materials)
    several = [held.of_triangles(held.uv)] if held.uv and has_textures else []

    # Vertices with one normal and one place in the texture each.
    mesh, _, of, corner_like = split_creases(mesh, several)
    origin = Origin(of, total)
    if colours is not None:
        colours = colours[of]
    bare = NEUTRAL if colours is None else WHITE
    if held.material_of is None:
        yield Shape(mesh, bare, colours=colours), origin
        return

    # The faces of each material, those without texture coordinates apart.
    material_of = held.of_faces(held.material_of)
    uv = several[0].values[several[0].of[corner_like]] if several else np.full((len(mesh.vertices), 2), np.nan)
    has_uv = ~np.isnan(uv[mesh.faces]).any(axis=(1, 2))
    group = 2 * material_of + has_uv
    parts = ObjectSelection(mesh, np.ones(len(group), np.bool_), group).parts()
    for number, (vertices, part) in zip(np.unique(group), parts, strict=True):
        material = materials[number // 2] if number >= 0 else None
        texture = Texture(material.texture) if material and material.texture and number % 2 else None
        own_uv = uv[vertices] if texture else None
        own_colours = None if colours is None else colours[vertices]
        shape = Shape(part, reflection(material) if material else bare, own_uv, texture, colours=own_colours)
        yield shape, Origin(of[vertices], total)
        total = 0  # of further parts of the file
