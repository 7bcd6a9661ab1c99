"""Copies of geometry and where they are placed: limits of their number, rotations as matrices (3, 3), float64."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import InputError, MeshError
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.types import Float64s

MAX_COPIED = 20_000_000
_ROW = 80  # bytes of a placed vertex or triangle, with copies on the way to a mesh


def check_copies(
    elements: int, stored: int, source: object, error: type[InputError] = MeshError, field: str = "objects"
) -> None:
    """Refuse a small file that fills the memory by repeating its `field`. Raises: `error`, MemoryLimitError.

    Args: elements: vertices and triangles, counted wherever they are placed. Each takes a byte or more where it is
        stored. stored: bytes that hold them.
    """
    limit = max(stored, MAX_COPIED)
    if elements > limit:
        raise error(source, field, f"at most {limit:,} vertices and triangles with all copies", f"{elements:,}")
    check_memory(source, _ROW * elements, f"to place {elements:,} vertices and triangles")


def cofactors(linear: Float64s) -> Float64s:
    """The cofactor matrices of (…, 3, 3), det · inverse transpose, which exist for flattening ones too."""
    x, y, z = np.moveaxis(linear, -2, 0)
    return np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=-2)


def rotation_of_quaternion(quaternion: npt.ArrayLike) -> Float64s:
    """The rotation of a quaternion (x, y, z, w) of any length. Raises: ValueError: of length zero."""
    components = np.asarray(quaternion, np.float64)
    length = np.linalg.norm(components)
    if not length > 0:
        raise ValueError("a rotation by a quaternion of length zero")
    x, y, z, w = components / length
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), -x * x - y * y + z * z + w * w],
        ]
    )


def rotation_about(axis: npt.ArrayLike, degrees: float) -> Float64s:
    """The rotation by an angle about an axis of any length but zero, counterclockwise seen from its tip."""
    half = np.radians(degrees) / 2
    unit = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    return rotation_of_quaternion([*(np.sin(half) * unit), np.cos(half)])


def rotation_about_axes(degrees: npt.ArrayLike) -> Float64s:
    """The rotation by three angles about the fixed axes x, y and z, in this order."""
    x, y, z = np.asarray(degrees, np.float64)
    return rotation_about([0, 0, 1], z) @ rotation_about([0, 1, 0], y) @ rotation_about([1, 0, 0], x)
