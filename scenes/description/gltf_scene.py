"""A glTF or GLB file as a scene: objects, materials, base colour and occlusion textures, camera and lights.

A camera's node looks along its −z with +y upwards. The vertical angle (or `ymag`) is kept whatever the picture's shape.
Format: Khronos glTF 2.0 specification, section 3.10 (cameras).
"""

from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from raytrace import Camera, Mesh, MeshError, Object, Occlusion, OptionError, Scene, Settings, Shape
from raytrace.errors import printable
from raytrace.mesh.normals import normalize
from raytrace.types import Float64s

from ..field_errors import located
from ..formats.gltf.asset import DrawnPrimitive, Gltf, entry
from ..formats.gltf.records import GltfCamera
from ..formats.gltf.textures import Textures, vertex_colours
from ..formats.load import mesh_errors, read_objects
from ..geometry.instances import Instance
from . import gltf_lights
from .defaults import BACKGROUND, framing, three_lights
from .description import SceneDescription
from .gltf_materials import Materials


def read_gltf(path: Path, settings: Settings, up: str | None = None, view: str | None = None) -> SceneDescription:
    """A whole glTF scene; y is up, as glTF has it, unless `up` says otherwise.

    Without a camera, or with a `view`, everything is framed; without lights there are three of our own.

    Raises:
        MeshError: the file cannot be read (`scenes.load`).
        SceneError: a texture, light or camera cannot be used.
        OptionError: `up`, and the file has a camera of its own.
    """
    objects, asset, notes = gltf_objects(path)
    with mesh_errors(path):
        camera = None if view else _camera(asset)
        lights = gltf_lights.lights(asset)
        if camera and up is not None:
            raise OptionError("--up", "a file without a camera", f"{path}, which has one")
        camera = camera or framing(Scene(objects).flattened(), up, settings.width, settings.height, view)
    scene = Scene(objects, lights or three_lights(camera), BACKGROUND)
    return SceneDescription(scene, camera, settings, files=asset.files, notes=notes)


def gltf_objects(path: Path) -> tuple[tuple[Object, ...], Gltf, tuple[str, ...]]:
    """The drawn primitives of a file, sharing shapes by mesh, the asset, and notes on what is left out.

    Objects that their nodes flatten to nothing (a scale of zero hides, in glTF) are left out.

    Raises:
        MeshError: the file cannot be read, or draws no triangles.
        SceneError: a texture cannot be used.
    """
    instances, asset = read_objects(path, alpha=True)
    if asset is None:
        raise MeshError(path, "file", "glTF or GLB", path.suffix)
    with mesh_errors(path):
        asset.check_materials()
        textures = Textures(asset)
        materials = Materials(textures)
        shapes: dict[tuple[int, int], Shape] = {}
        objects = []
        for piece, placed in zip(asset.drawn, instances, strict=True):
            if placed.is_flattened:
                continue
            matrix = np.eye(4) if placed.matrix is None else placed.matrix
            key = (piece.mesh, piece.place)
            if key not in shapes:
                shapes[key] = _shape(piece, placed, materials, textures)
            objects.append(Object(shapes[key], matrix, placed.name))
    if not objects:
        raise MeshError(path, "nodes", "at least one triangle to see", "none")
    return tuple(objects), asset, tuple(map(printable, materials.notes))


def _shape(piece: DrawnPrimitive, placed: Instance, materials: Materials, textures: Textures) -> Shape:
    asset, path = textures.asset, textures.asset.path
    primitive = piece.primitive
    uv, texture = textures.of_base(primitive) or (None, None)
    name = f"{path}: {placed.name}"
    mesh = Mesh(placed.vertices, placed.faces, placed.normals, source=name, opacity=placed.opacity)
    occlusion = textures.of_occlusion(primitive)
    with located(path, f"materials[{primitive.material}]"):
        colours = vertex_colours(asset, primitive, placed.w)
        material = materials.of(primitive, colours is not None)
        return Shape(mesh, material, uv, texture, occlusion and Occlusion(*occlusion), colours=colours)


def _camera(asset: Gltf) -> Camera | None:
    """The first camera among the nodes that are shown, or None."""
    cameras = asset.stage.cameras
    for node, matrix in asset.world.items():
        number = asset.geometry.nodes[node].camera
        if number is not None:
            with located(asset.path, f"cameras[{number}]"):
                return _seen_by(entry(cameras, number, "cameras"), matrix)
    return None


def _seen_by(stored: GltfCamera, matrix: Float64s) -> Camera:
    target = matrix[:3, 3] - normalize(matrix[:3, 2])
    view: dict[str, Any] = {"position": matrix[:3, 3].tolist(), "target": target.tolist(), "up": matrix[:3, 1].tolist()}
    if stored.type == "orthographic":
        return Camera(**view, height=2.0 * stored.ymag)
    return Camera(**view, field_of_view=degrees(stored.yfov))
