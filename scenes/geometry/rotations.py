"""Rotations as matrices (3, 3), float64: of a quaternion, about an axis, about x, y and z in turn."""

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.types import Float64s


def of_quaternion(quaternion: npt.ArrayLike) -> Float64s:
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


def about(axis: npt.ArrayLike, degrees: float) -> Float64s:
    """The rotation by an angle about an axis of any length but zero, counterclockwise seen from its tip."""
    half = np.radians(degrees) / 2
    unit = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    return of_quaternion([*(np.sin(half) * unit), np.cos(half)])


def about_axes(degrees: npt.ArrayLike) -> Float64s:
    """The rotation by three angles about the fixed axes x, y and z, in this order."""
    x, y, z = np.asarray(degrees, np.float64)
    return about([0, 0, 1], z) @ about([0, 1, 0], y) @ about([1, 0, 0], x)
