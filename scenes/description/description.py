"""The content of a scene file, and defaults of files without camera, lights or material: all framed, matt grey."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from obscurance.ao.options import Options
from obscurance.raytrace import Camera, Lambert, Mesh, Scene, Settings
from obscurance.raytrace.errors import OptionError, nearest_name
from obscurance.raytrace.lights.sources import AmbientLight, BaseLight, DirectionalLight
from obscurance.raytrace.mesh.mesh import TO_Y_UP, UP, up_axis
from obscurance.raytrace.types import Int64s

from ..formats.falloffs import Scales
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
    """Lights of terrain, where z is up and y is north: the sun 40° high in the north-west, and a sky of less light.

    Level ground is grey, so that slopes are lighter and darker.
    """
    sun = DirectionalLight(direction=(0.54, -0.54, -0.64), intensity=(2.1, 2.0, 1.85))
    return sun, AmbientLight(intensity=(0.22, 0.24, 0.28))


def three_lights(camera: Camera) -> tuple[BaseLight, ...]:
    """Key from the upper left of the picture, fill from the right, rim from behind, and a little ambient light.

    A white surface that faces the key is as bright as a picture shows, about 1.
    """
    right, above, forward = camera.axes()

    def light(towards: Vector, intensity: Vector) -> DirectionalLight:
        """A light from a direction, given to the right, upwards and forward in the picture."""
        return DirectionalLight(direction=(np.array(towards) @ [right, above, forward]).tolist(), intensity=intensity)

    return (
        light((0.65, -0.75, 0.7), (3.2, 3.1, 2.9)),
        light((-0.9, -0.2, 0.6), (0.5, 0.58, 0.7)),
        light((-0.3, -0.6, -1.0), (1.6, 1.6, 1.65)),
        AmbientLight(intensity=(0.15, 0.16, 0.18)),
    )
