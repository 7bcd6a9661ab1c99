"""Default camera, lights and material of files without their own: all framed, three-point lighting, matt grey."""

import numpy as np

from raytrace import Camera, Lambert, Mesh
from raytrace.errors import OptionError, nearest_name
from raytrace.lights.sources import AmbientLight, BaseLight, DirectionalLight
from raytrace.mesh.up import TO_Y_UP, UP, up_axis

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
    turn, above = np.array(TO_Y_UP[up_axis(mesh, up)]), UP[up_axis(mesh, up)]
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


def three_lights(camera: Camera) -> tuple[BaseLight, ...]:
    """Key from the upper left of the picture, fill from the right, rim from behind, and a little ambient light.

    A white surface that faces the key is as bright as a picture shows, about 1.
    """
    right, above, forward = camera.axes()

    def light(towards: Vector, intensity: Vector) -> DirectionalLight:
        return DirectionalLight(direction=(np.array(towards) @ [right, above, forward]).tolist(), intensity=intensity)

    return (
        light((0.65, -0.75, 0.7), (3.2, 3.1, 2.9)),
        light((-0.9, -0.2, 0.6), (0.5, 0.58, 0.7)),
        light((-0.3, -0.6, -1.0), (1.6, 1.6, 1.65)),
        AmbientLight(intensity=(0.15, 0.16, 0.18)),
    )
