"""The content of a scene file, and defaults of files without camera, lights or material: all framed, matt grey."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, Self

import numpy as np

from obscurance.ao.options import Options
from obscurance.raytrace import Camera, Lambert, Mesh, Scene, Settings
from obscurance.raytrace.errors import OptionError, nearest_name
from obscurance.raytrace.lights.sources import AmbientLight, BaseLight, DirectionalLight
from obscurance.raytrace.mesh.mesh import TO_Y_UP, UP, up_axis
from obscurance.raytrace.types import Int64s

from ..formats.stored_w import Scales
from ..geometry.instances import rotation_about
from ..geometry.primitives import Origin

Source = Literal["bake", "off"] | Path


@dataclass(frozen=True, eq=False)
class SceneDescription:
    """A scene file's content.

    Attributes:
        scene: objects, lights and background; no object has its w yet.
        camera: the file's own, or one that frames everything.
        settings: of the picture.
        w_from: where w(p) comes from: "bake" it for this picture; "off" (w = 1), exactly when `settings.obscurance` is;
            or a file of `obscurance bake` with one value a vertex of `Scene.flattened()`: `.npy`, `.npz`, `.ply`,
            `.glb`, `.gltf`, `.tif`.
        scales: of the file's profile, in place of its w.
        lit_from_camera: whether its lights are `three_lights`, which go where the camera goes.
        is_framed: whether the camera is one that frames everything.
        bake: falloff, samples and seed of a bake.
        files: every file that the scene is made of: its own, meshes, textures, w.
        notes: warnings about them.
        origins: of the vertices of each object, None where they are its file's one by one; or nothing, if all are.
    """

    scene: Scene
    camera: Camera
    settings: Settings = field(default_factory=Settings)
    w_from: Source = "bake"
    bake: Options = field(default_factory=Options)
    files: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()
    origins: tuple[Origin | None, ...] = ()
    scales: Scales | None = None
    lit_from_camera: bool = False
    is_framed: bool = False

    def turntable(self, frames: int) -> list[Self]:
        """The description for each of so many pictures of one turn: the camera goes around the scene about the axis
        along its `up` through the point of its line of sight nearest to the scene's middle.

        Lights stay, but those that no file has. Raises: OptionError: `frames` is below 1.
        """
        if frames < 1:
            raise OptionError("turntable", "a number of pictures, at least 1", frames)
        mesh, camera = self.scene.flattened(), self.camera
        position = np.array(camera.position)
        target = np.array(camera.target)
        forward = camera.axes()[2]
        pivot = position + max(float((mesh.centre - position) @ forward), 0.0) * forward
        views = []
        for number in range(frames):
            turn = rotation_about(camera.up, 360 * number / frames)
            places = [(pivot + turn @ (place - pivot)).tolist() for place in (position, target)]
            views.append(replace(camera, position=places[0], target=places[1]))
        if self.is_framed:  # as far away as the farthest, so that nothing is cut off
            aspect = self.settings.width / self.settings.height
            framed = [Camera.framing(mesh, (-view.axes()[2]).tolist(), view.up, aspect) for view in views]
            far = max(float(np.linalg.norm(view.position - mesh.centre)) for view in framed)
            views = [replace(view, position=(mesh.centre - far * view.axes()[2]).tolist()) for view in framed]
        lights = [three_lights(view) if self.lit_from_camera else self.scene.lights for view in views]
        return [
            replace(self, camera=view, scene=replace(self.scene, lights=lit))
            for view, lit in zip(views, lights, strict=True)
        ]

    def file_vertices(self) -> tuple[Int64s, int]:
        """For each vertex of the scene the one of the mesh files, all after one another, and how many these have."""
        file_rows = []
        start = 0
        total = 0
        for number, item in enumerate(self.scene.objects):
            count = len(item.shape.mesh.vertices)
            origin = self.origins[number] if self.origins else None
            size = origin.total if origin else count
            if size:
                start = total
                total += size
            file_rows.append(start + (origin.of if origin else np.arange(count)))
        return np.concatenate(file_rows), total


Vector = tuple[float, float, float]

BACKGROUND = (0.05, 0.05, 0.05)
NEUTRAL = Lambert(albedo=(0.7, 0.7, 0.7))
WHITE = Lambert(albedo=(1.0, 1.0, 1.0))  # of a mesh that has colours and no material
VIEWS = {"front": (0, 0, 1), "back": (0, 0, -1), "right": (1, 0, 0), "left": (-1, 0, 0), "top": (0, 1, 0),
         "bottom": (0, -1, 0)}  # fmt: skip
"""From a mesh to the camera, where y is up and the front is at z, as in glTF."""


def framing(mesh: Mesh, up: str | None, width: int, height: int, view: str | None = None) -> Camera:
    """A camera that sees every vertex, with `up` in place of `Mesh.up`, from the front, the right and above.

    Args: view: one of `VIEWS`, or "X,Y,Z", from the mesh to the camera. Raises: OptionError: `up` or `view` is none.
    """
    turn = np.array(TO_Y_UP[up_axis(mesh, up)])
    above = UP[up_axis(mesh, up)]
    if view is None:
        return Camera.framing(mesh, up=above, aspect=width / height)
    try:
        towards = np.array([float(part) for part in view.split(",")]) if view not in VIEWS else VIEWS[view] @ turn
    except ValueError:
        towards = np.zeros(3)
    if towards.shape != (3,) or not 0 < np.abs(towards).max() < np.inf:
        expected = f"{', '.join(VIEWS)}, or a direction X,Y,Z"
        raise OptionError("view", expected, view, nearest=nearest_name(view, VIEWS))
    if not np.cross(towards, above).any():  # the back is upwards from the top
        above = tuple(np.array([0, 0, -np.sign(towards @ above)]) @ turn)
    return Camera.framing(mesh, tuple(towards), above, aspect=width / height)


def sun_and_sky() -> tuple[BaseLight, ...]:
    """Lights of terrain, where z is up and y is north: the sun 40° high in the north-west, and a sky of more light, in
    which w shows.

    Level ground is grey, so that slopes are lighter and darker.
    """
    sun = DirectionalLight(direction=(0.54, -0.54, -0.64), intensity=(1.2, 1.14, 1.06))
    return sun, AmbientLight(intensity=(0.4, 0.43, 0.48))


def three_lights(camera: Camera) -> tuple[BaseLight, ...]:
    """Key from the upper left of the picture, fill from the right, rim from behind, and ambient light, which w darkens.

    A white surface that faces the key is as bright as a picture shows, about 1, half of it by ambient light.
    """
    right, above, forward = camera.axes()

    def light(towards: Vector, intensity: Vector) -> DirectionalLight:
        """A light from a direction, given to the right, upwards and forward in the picture."""
        return DirectionalLight(direction=(np.array(towards) @ [right, above, forward]).tolist(), intensity=intensity)

    return (
        light((0.65, -0.75, 0.7), (1.5, 1.45, 1.36)),
        light((-0.9, -0.2, 0.6), (0.2, 0.23, 0.28)),
        light((-0.3, -0.6, -1.0), (0.6, 0.6, 0.62)),
        AmbientLight(intensity=(0.5, 0.52, 0.55)),
    )
