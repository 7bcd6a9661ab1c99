"""Where a picture is taken from: rays through the pixels of a perspective view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .mesh import Mesh
from .normals import normalize

Floats = npt.NDArray[np.float64]
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes:
        position, target, up: (3,), mesh units; `up` need not be perpendicular to the view.
        field_of_view: full vertical angle in degrees, in (0, 180).
    """

    position: Vector
    target: Vector
    up: Vector = (0.0, 0.0, 1.0)
    field_of_view: float = 35.0

    @classmethod
    def framing(cls, mesh: Mesh, direction: Vector, up: Vector = (0.0, 0.0, 1.0), aspect: float = 1.0) -> Camera:
        """A camera in `direction` from the mesh's centre, just far enough away to see every vertex.

        Args: aspect: width over height of the picture.
        """
        view = cls((0.0, 0.0, 0.0), _vector(-normalize(np.array(direction))), up)
        right, above, forward = view.axes()
        half = np.tan(np.radians(view.field_of_view / 2))
        offset = mesh.vertices - mesh.centre
        across = np.maximum(np.abs(offset @ right) / aspect, np.abs(offset @ above))
        distance = 1.05 * float(np.max(across / half - offset @ forward))
        return cls(_vector(mesh.centre - distance * forward), _vector(mesh.centre), up)

    def axes(self) -> tuple[Floats, Floats, Floats]:
        """Unit vectors to the right, upwards and forward of the picture."""
        forward = normalize(np.subtract(self.target, self.position))
        right = normalize(np.cross(forward, self.up))
        return right, np.cross(right, forward), forward

    def directions(self, x: Floats, y: Floats) -> Floats:
        """Unit directions (…, 3) through film points; y in [−1, 1] spans the field of view upwards, x to the right."""
        right, above, forward = self.axes()
        half = np.tan(np.radians(self.field_of_view / 2))
        return normalize(forward + half * (x[..., None] * right + y[..., None] * above))


def _vector(values: Floats) -> Vector:
    x, y, z = (float(c) for c in values)
    return x, y, z
