"""Perspective and orthographic cameras: a view of the scene and the rays through its pixels."""

from __future__ import annotations

from math import inf
from typing import Annotated, Any

import numpy as np

from .errors import OptionError, numbers
from .kernel.arrays import product
from .mesh.mesh import TO_Y_UP, UP, Mesh, mesh_of, up_axis
from .mesh.normals import normalize
from .system.parameters import Parameters, Point
from .system.records import Within
from .types import Float64s

Vector = Annotated[Point, "three finite numbers"]
Degrees = Annotated[float, Within(0, 180, "()", "degrees above 0 and below 180")]
Length = Annotated[float, Within(0, inf, "()", "a finite length above 0")]
Diameter = Annotated[float, Within(0, inf, "[)", "a finite length of 0 or more")]
_FROM = (0.55, 0.4, 1.0)


def _turned_back(axes: tuple[Vector, Vector, Vector]) -> Vector:
    """The usual view direction in the frame that `axes`, x, y and z, take to a mesh with z up."""
    x, y, z = np.array(_FROM) @ axes
    return float(x), float(y), float(z)


FROM = {axes[1]: _turned_back(axes) for axes in TO_Y_UP.values()}
"""From the front, the right and above, by what is up."""


class Camera(Parameters, kw_only=False, source="camera"):
    """A view of the scene.

    Attributes:
        position: (3,), world units.
        target: (3,), world units, the middle of the picture.
        up: (3,), what is upwards in the picture; it need not be perpendicular to the view.
        field_of_view: full vertical angle of a perspective view in degrees, in (0, 180).
        height: full height of an orthographic view in world units, or None for a perspective one.
        aperture: diameter of a thin lens in world units; 0 is a pinhole, everything sharp.
        focus: distance from `position` at which all is sharp; None: at `target`.

    Raises:
        OptionError: a value out of range, or a view that has no direction.
    """

    position: Vector
    target: Vector
    up: Vector = (0.0, 0.0, 1.0)
    field_of_view: Degrees = 35.0
    height: Length | None = None
    aperture: Diameter = 0.0
    focus: Length | None = None

    def check(self) -> None:
        right, _, forward = self.axes()
        if not forward.any():
            raise OptionError("target", "a point other than position", self.target, "camera")
        if not right.any():
            raise OptionError("up", "a direction other than the view's", self.up, "camera")

    @classmethod
    def framing(
        cls,
        mesh: Mesh | Any,
        direction: Vector | None = None,
        up: Vector | None = None,
        aspect: float = 1.0,
        field_of_view: float = 35.0,
    ) -> Camera:
        """A camera in `direction` from the mesh's centre, just far enough away to see every vertex.

        Args:
            mesh: in any form that `ao.bake` takes.
            direction: (3,), from the centre to the camera; by default from the front, the right and above.
            up: (3,), as `Camera` has it; by default what is up in the mesh, y unless it says otherwise.
            aspect: width over height of the picture.
            field_of_view: vertical, in degrees.
        """
        mesh = mesh_of(mesh, "camera")
        up = UP[up_axis(mesh)] if up is None else up
        direction = FROM.get((up[0], up[1], up[2])) if direction is None else direction
        towards = numbers(direction, "camera", "direction", "three numbers")
        if towards.shape != (3,):
            raise OptionError("direction", "three numbers", direction, "camera")
        view = cls((0.0, 0.0, 0.0), (-normalize(towards)).tolist(), up, field_of_view)
        right, above, forward = view.axes()
        half = np.tan(np.radians(view.field_of_view / 2))
        offset = mesh.used - mesh.centre
        across = np.maximum(np.abs(product(offset, right)) / aspect, np.abs(product(offset, above)))
        distance = 1.05 * float(np.max(across / half - product(offset, forward))) or 1.0
        return cls((mesh.centre - distance * forward).tolist(), mesh.centre.tolist(), up, field_of_view)

    def axes(self) -> tuple[Float64s, Float64s, Float64s]:
        """Unit vectors to the right, upwards and forward of the picture; zero where there is none."""
        forward = normalize(np.subtract(self.target, self.position))
        right = normalize(np.cross(forward, normalize(np.array(self.up))))
        return right, np.cross(right, forward), forward

    def directions(self, x: Float64s, y: Float64s) -> Float64s:
        """Unit directions (…, 3) of a pinhole through film points; y in [−1, 1] spans the view upwards."""
        right, above, forward = self.axes()
        half = np.tan(np.radians(self.field_of_view / 2))
        return normalize(forward + half * (x[..., None] * right + y[..., None] * above))
