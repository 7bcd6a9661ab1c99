"""A glTF or GLB file as a scene: objects, materials, base colour and occlusion textures, camera and lights.

A camera's node looks along its −z with +y upwards. The vertical angle (or `ymag`) is kept whatever the picture's shape.
Intensities of lights are taken as they are: candela as watts per steradian, lux as watts per square metre, times the
colour. A spot's edge differs: glTF's falls off as ((cosφ − cos outer)/(cos inner − cos outer))² from the inner to the
outer angle, ours as cos^e φ up to the outer. e is the exponent for which both cones send out the same power; inner =
outer gives e = 0.
Format: Khronos glTF 2.0 specification, section 3.10 (cameras); KHR_lights_punctual.
"""

from collections.abc import Callable, Iterator, Sequence
from math import cos, degrees, pi
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from raytrace import Camera, Mesh, MeshError, Object, Occlusion, OptionError, Scene, Settings, Shape, light_from_dict
from raytrace.errors import printable
from raytrace.lights.sources import BaseLight
from raytrace.mesh.normals import normalize
from raytrace.types import Float64s

from ..field_errors import located
from ..formats.gltf.asset import DrawnPrimitive, Gltf, entry
from ..formats.gltf.records import LIGHTS, GltfCamera, GltfLight
from ..formats.gltf.textures import Textures, vertex_colours
from ..formats.load import mesh_errors, read_objects
from ..geometry.instances import Instance
from .defaults import BACKGROUND, framing, three_lights
from .description import SceneDescription
from .gltf_materials import Materials

_FLOAT32_RIGHT_ANGLE = 1.5707964
T = TypeVar("T")


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
        cameras = _placed(asset, "camera", "cameras", asset.stage.cameras, _camera)
        camera = None if view else next(cameras, None)
        lights = tuple(_placed(asset, "light", LIGHTS, asset.stage.lights, _light))
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
        _ = asset.materials  # to find what is malformed
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


def _placed(
    asset: Gltf, field: str, name: str, stored: Sequence[Any], make: Callable[[Any, Float64s], T]
) -> Iterator[T]:
    """The cameras or lights of the nodes that are shown, in their order."""
    for node, matrix in asset.world.items():
        number = getattr(asset.geometry.nodes[node], field)
        if number is not None:
            with located(asset.path, f"{name}[{number}]"):
                placed = make(entry(stored, number, name), matrix)
            yield placed


def _camera(stored: GltfCamera, matrix: Float64s) -> Camera:
    target = matrix[:3, 3] - normalize(matrix[:3, 2])
    view: dict[str, Any] = {"position": matrix[:3, 3].tolist(), "target": target.tolist(), "up": matrix[:3, 1].tolist()}
    if stored.type == "orthographic":
        return Camera(**view, height=2.0 * stored.ymag)
    return Camera(**view, field_of_view=degrees(stored.yfov))


def _light(stored: GltfLight, matrix: Float64s) -> BaseLight:
    intensity = [stored.intensity * channel for channel in stored.color]
    values: dict[str, Any] = {"light": stored.type, "intensity": intensity}
    if stored.type != "directional":
        values |= {"position": matrix[:3, 3], "range": stored.range}
    if stored.type != "point":
        values["direction"] = -matrix[:3, 2]
    if stored.type == "spot":
        outer = stored.outerConeAngle
        values["half_angle"] = 90.0 if pi / 2 < outer <= _FLOAT32_RIGHT_ANGLE else degrees(outer)
        values["exponent"] = spot_exponent(stored.innerConeAngle, outer)
    return light_from_dict(values)


def spot_exponent(inner: float, outer: float) -> float:
    """e for which ∫ cos^e φ dω over the outer cone is glTF's.

    Over 2π: (1 − cos^(e+1) outer)/(e + 1) = 1 − (2 cos inner + cos outer)/3.

    Args: angles from the axis in radians, 0 ≤ inner ≤ outer ≤ π/2.
    """
    edge = max(cos(outer), 0.0)
    power = 1.0 - (2 * cos(min(inner, outer)) + edge) / 3.0
    if not 0.0 < power < 1.0 - edge:
        return 0.0
    from scipy.optimize import brentq  # loads for a quarter of a second

    return float(brentq(lambda e: (1.0 - edge ** (e + 1.0)) / (e + 1.0) - power, 0.0, 1.0 / power))
