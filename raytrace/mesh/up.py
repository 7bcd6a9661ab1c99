"""The up axis: axes by name, and rotations to y up."""

from typing import Any

import numpy as np

from ..errors import OptionError

Vector = tuple[float, float, float]

TO_Y_UP: dict[str, tuple[Vector, Vector, Vector]] = {
    "x": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    "y": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "z": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)),
    "-x": ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "-y": ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "-z": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
}
"""Rows of the rotation that turns each axis to y; of z it is that of −90° about x."""
UP = {name: axes[1] for name, axes in TO_Y_UP.items()}
_FROM = (0.55, 0.4, 1.0)


def _turned_back(axes: tuple[Vector, Vector, Vector]) -> Vector:
    """The usual view direction in the frame that `axes`, x, y and z, take to a mesh with z up."""
    x, y, z = np.array(_FROM) @ axes
    return float(x), float(y), float(z)


FROM = {axes[1]: _turned_back(axes) for axes in TO_Y_UP.values()}
"""From the front, the right and above, by what is up."""


def up_axis(mesh: Any, up: str | None = None) -> str:
    """The axis `up`, or else the one that is up in a `Mesh`, y if that does not say.

    Raises: OptionError: `up` is none of `UP`.
    """
    if up is not None and up not in UP:
        raise OptionError("up", "one of " + ", ".join(UP), up)
    return up or mesh.up or "y"
