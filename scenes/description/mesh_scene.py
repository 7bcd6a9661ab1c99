"""Mesh files as scenes and in scenes, with their materials, textures and colours of vertices.

A file alone is a scene: an object for each of its parts and materials, framed whole, under three lights. glTF brings
cameras and lights (`gltf_scene`). Kd and Ks of an OBJ's materials are the reflectances of Blinn–Phong, Ns is its
exponent (Wavefront MTL 5.0, illum 2); divided by π, as Lambert's is, for lights in physical units.

Neither OBJ nor PLY says how colours are encoded. They are taken as sRGB, as most programs write and show them. The grey
that a bake has given a PLY shows w, and is no colour.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np

from obscurance.raytrace import (
    BlinnPhong,
    Camera,
    Lambert,
    Material,
    MeshError,
    Object,
    Occlusion,
    OptionError,
    Scene,
    Settings,
    Texture,
)
from obscurance.raytrace.errors import printable
from obscurance.raytrace.lights.sources import BaseLight
from obscurance.raytrace.mesh.corners import split_creases
from obscurance.raytrace.mesh.warnings import lying_notes
from obscurance.raytrace.scene import Shape
from obscurance.raytrace.types import Float64s, Int64s

from ..asset import material as stored
from ..asset.asset import Asset, Node
from ..asset.objects import ObjectSelection
from ..asset.primitive import Column, Primitive
from ..formats.load import load, parser_errors, read_asset
from ..formats.table import format_of, is_raster
from ..geometry.primitives import Origin, TexturedMesh
from .description import BACKGROUND, NEUTRAL, WHITE, SceneDescription, framing, sun_and_sky, three_lights

_COLOURS = "colours", "texture of map_Kd", "texture of diffuse"  # how words on what is left out begin
Placed = tuple[Object, Origin]


def mesh_scene(source: Asset, settings: Settings, up: str | None = None, view: str | None = None) -> SceneDescription:
    """The scene of a mesh file, in its materials, the colours of its vertices, or grey; glTF's with its camera, unless
    there is a `view`, and its lights. Args: up, view: as `framing`.

    Raises: as `placed`. OptionError: `up`, and the file has a camera of its own.
    """
    pairs = list(placed(source))
    own_camera: Camera | None = None
    lights: tuple[BaseLight, ...] = ()
    if source.is_scene:
        from .gltf_scene import camera_and_lights

        own_camera, lights = camera_and_lights(source, view is None)
    if own_camera and up is not None:
        raise OptionError("--up", "a file without a camera", f"{source.path}, which has one")
    is_terrain = is_raster(source.path)
    shown = _shown(source)
    camera = own_camera or framing(shown.mesh, up, settings.width, settings.height, view)
    lit_from_camera = not lights and not is_terrain
    lights = lights or (sun_and_sky() if is_terrain else three_lights(camera))
    notes = [*source.notes, *colours_left_out(source.path, source.unread)]
    if not source.up:
        notes += lying_notes(shown.mesh, up)
    return SceneDescription(
        Scene(tuple(item for item, _ in pairs), lights, BACKGROUND), camera, settings, files=source.files,
        notes=tuple(notes), origins=tuple(origin for _, origin in pairs), lit_from_camera=lit_from_camera,
        is_framed=own_camera is None,
    )  # fmt: skip


def read_source(path: Path) -> Asset:
    """A mesh file for `placed`: glTF's, whose objects may be very many, without one mesh of all. Raises: MeshError."""
    return read_asset(path, alpha=True) if "scene" in format_of(path).holds else load(path, names=True)


def placed(source: Asset) -> Iterator[Placed]:
    """The parts of a mesh file as objects, which share shapes by primitive, and the origins of their vertices.

    Raises: MeshError: it is malformed, or draws no triangles. SceneError: a texture cannot be used.
    """
    shapes: dict[int, list[tuple[Shape, Origin]]] = {}
    with parser_errors(source.path):
        _ = len(source.materials)  # to find what is malformed
        if all(part.is_flattened for part in source.parts):
            raise MeshError(source.path, "nodes", "at least one triangle to see", "none")
        shown = _shown(source)
        models = _reflections(shown)
        for part in shown.parts:
            if part.number not in shapes:
                alone = source
                if len(source.parts) > 1 or part.node.matrix is not None:
                    path = Path(f"{source.path}: {part.name}")  # as messages have it
                    alone = replace(source, path=path, nodes=(Node(part.name, (part.number,)),))
                shapes[part.number] = list(_shapes(alone, models))
            matrix = np.eye(4) if part.node.matrix is None else part.node.matrix
            for shape, origin in shapes[part.number]:
                yield Object(shape, matrix, part.name), origin


def _shown(source: Asset) -> Asset:
    """The asset without parts of which there is nothing to see: a scale of zero hides, in glTF."""
    seen = [part for part in source.parts if not part.is_flattened]
    if len(seen) == len(source.parts):
        return source
    return replace(source, nodes=tuple(part.node._replace(primitives=(part.number,)) for part in seen))


def _reflections(source: Asset) -> dict[int, Material]:
    """The reflection models of the materials that primitives have, by their numbers."""
    used = {number for part in source.parts for number in _distinct(part.primitive.of_faces(part.primitive.material))}
    numbers = sorted(used - {-1})
    if source.is_scene:
        from .gltf_scene import gltf_materials

        return gltf_materials(source, numbers)
    return {number: reflection(source.material(number)) for number in numbers}


def _distinct(numbers: Int64s) -> list[int]:
    """The distinct ones of numbers that are −2 or more, ascending."""
    return (np.flatnonzero(np.bincount(numbers + 2)) - 2).tolist()


def reflection(material: stored.Material) -> Material:
    """A material of a mesh file but glTF as a reflection model."""
    if not any(material.specular) or not material.exponent:
        return Lambert(albedo=material.colour, emission=material.emission)
    diffuse = np.divide(material.colour, pi)
    specular = np.divide(material.specular, pi)
    return BlinnPhong(
        k_d=diffuse, k_s=specular, k_a=material.colour, exponent=material.exponent, emission=material.emission
    )


def _shapes(source: Asset, models: Mapping[int, Material]) -> Iterator[tuple[Shape, Origin]]:
    """The shapes of a file's only part, one for the faces of each material, those without its texture coordinates
    apart; and their origins in the file. Vertices are repeated at creases and where texture coordinates jump."""
    primitive = source.parts[0].primitive
    total = len(primitive.positions)
    group, textures = _groups(source, primitive)
    numbers = _distinct(group)
    # Their vertices; where all are one shape that is split at creases alone, it does so itself.
    first = primitive.columns.get("uv0") if textures else None
    uv = source.per_corner("uv0") if first and first.of is not None else None
    split = split_creases(source.mesh, [uv] if uv else []) if uv or len(numbers) > 1 else None
    mesh = split.mesh if split else source.mesh
    of = split.vertices if split else np.arange(total)

    def at_vertices(column: Column, vertices: Int64s) -> Float64s:
        rows = of if split is None or column.of is None else primitive.rows(column).ravel()[split.like]
        return column.values[rows[vertices]]

    colours = primitive.shown_colours
    pieces = [(np.arange(len(of)), mesh)]
    if len(numbers) > 1:
        parts = ObjectSelection(mesh, np.ones(len(group), np.bool_), group).parts()
        pieces = [(vertices, piece) for vertices, _, piece in parts]
    for number, (vertices, piece) in zip(numbers, pieces, strict=True):
        column, texture = textures[number // 2] if number % 2 else (None, None)
        occlusion = source.material(number // 2).occlusion
        at = source.looked_up(primitive, occlusion)
        bare = NEUTRAL if colours is None else WHITE
        shape = Shape(
            piece,
            models.get(number // 2, bare),
            None if column is None else at_vertices(column, vertices),
            texture,
            Occlusion(at_vertices(at[0], vertices), at[1], occlusion.strength) if at and occlusion else None,
            colours=None if colours is None else colours[of[vertices]],
        )
        rows = of[vertices]
        if shape.split:
            shape, again = shape.split
            rows = rows[again]
        yield shape, Origin(rows, total)
        total = 0  # of further parts of the file


def _groups(source: Asset, primitive: Primitive) -> tuple[Int64s, dict[int, tuple[Column, Texture]]]:
    """The group (m,) of each face, twice the number of its material, and 1 more with texture coordinates; and the
    texture of each material that has one, with the column by which it is looked up."""
    group = 2 * primitive.of_faces(primitive.material)
    textures = {}
    for number in _distinct(group // 2):
        if found := source.looked_up(primitive, source.material(number).texture):
            textures[number] = found
            faces = np.flatnonzero(group == 2 * number)
            group[faces] += ~np.isnan(found[0].values[primitive.rows(found[0])[faces]]).any(axis=(1, 2))
    return group, textures


def read_mesh(path: Path, textured: bool, own_normals: bool = True) -> tuple[TexturedMesh, list[str]]:
    """The mesh of a file, with texture coordinates if it is to be `textured` and all corners have some; and warnings.

    Every combination of a vertex with a normal (`raytrace.mesh.normals.corner_normals`), and with a texture coordinate,
    becomes a vertex, after the file's own. Args: own_normals: whether the file's are asked for.
    """
    file = load(path, names=True)
    notes = [*file.notes, *colours_left_out(path, file.unread)]
    colours = file.colours()
    uv = file.per_corner("uv0") if textured else None
    several = [uv] if uv and not np.isnan(uv.values[uv.of]).any() else []
    split = split_creases(file.mesh, several, own_normals)
    origin = Origin(split.vertices, len(file.mesh.vertices))
    of_corners = several[0].values[several[0].of[split.like]] if several else None
    linear = None if colours is None else colours[split.vertices, :3].clip(0.0, 1.0)
    return TexturedMesh(split.mesh, of_corners, origin, linear), notes


def colours_left_out(path: Path, unread: Iterable[str]) -> list[str]:
    """Warnings about colours and pictures among the parts of a file that are not read, `unread`."""
    pictures = "; of pictures are read PNG and JPEG, in the mesh's folder or below"
    ends = {words: pictures if words.startswith("texture") else "" for words in unread if words.startswith(_COLOURS)}
    return [printable(f"{path}: left out: {words}{end}") for words, end in ends.items()]
