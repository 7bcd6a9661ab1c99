"""Default camera, lights and material of files without their own: all framed, three-point lighting, matt grey."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from raytrace import Camera, Lambert, Mesh, OptionError
from raytrace.lights.sources import AmbientLight, BaseLight, DirectionalLight

Vector = tuple[float, float, float]

BACKGROUND = (0.05, 0.05, 0.05)
X_UP: Vector = (1.0, 0.0, 0.0)
Y_UP: Vector = (0.0, 1.0, 0.0)
Z_UP: Vector = (0.0, 0.0, 1.0)
UP = {"x": X_UP, "y": Y_UP, "z": Z_UP}
FROM = {X_UP: (0.4, 0.55, -1.0), Y_UP: (0.55, 0.4, 1.0), Z_UP: (0.55, -1.0, 0.4)}  # from the front, the right and above
_Z_UP_ENDINGS = (".stl", ".3mf")
NEUTRAL = Lambert(albedo=(0.7, 0.7, 0.7))
WHITE = Lambert(albedo=(1.0, 1.0, 1.0))  # of a mesh that has colours and no material


def up_axis(path: Path, up: str | None = None) -> Vector:
    """The axis `up`, "x", "y" or "z", or else the one that a file's format has as a rule: y, in STL and 3MF z.

    Raises: OptionError: `up` is another.
    """
    if up is None:
        return Z_UP if path.suffix.lower() in _Z_UP_ENDINGS else Y_UP
    if up not in UP:
        raise OptionError("--up", "one of " + ", ".join(UP), up)
    return UP[up]


def framing(mesh: Mesh, up: Vector, width: int, height: int) -> Camera:
    """A camera that sees every vertex in a picture of `width` × `height` pixels; `up` is one of `UP`."""
    return Camera.framing(mesh, FROM[up], up, width / height)


def three_lights(camera: Camera) -> tuple[BaseLight, ...]:
    """Key from the upper left of the picture, fill from the right, rim from behind, and a little ambient light.

    The first three are directional; a white surface that faces the key is as bright as a picture shows, about 1.
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
