"""Transforms of a TOML scene as matrices: translate, rotate, scale, or a matrix."""

from typing import Any

import numpy as np

from raytrace.errors import SceneError
from raytrace.types import Float64s

from ..field_errors import joined, shown
from .schema import Transform


def matrix_of(table: Transform, source: object, path: str) -> Float64s:
    """The affine (4, 4) map for column vectors: scale, then rotate, then translate.

    Raises:
        SceneError: a zero scale or axis, a singular matrix, or keys that exclude each other.
    """

    def fault(key: str, expected: str, got: object) -> SceneError:
        return SceneError(source, joined(path, key), expected, got)

    given = [key for key in Transform.model_fields if getattr(table, key) is not None]
    if table.matrix is not None:
        if given != ["matrix"]:
            raise fault("matrix", "nothing beside it", ", ".join(key for key in given if key != "matrix"))
        matrix = np.array(table.matrix)
        if not np.linalg.det(matrix[:3, :3]):
            raise fault("matrix", "an invertible matrix", shown(table.matrix))
        return matrix
    if table.scale is not None and 0 in table.scale:
        raise fault("scale", "numbers other than 0", list(table.scale))
    if (table.axis is None) != (table.angle is None):
        raise fault("axis" if table.axis is None else "angle", "axis and angle together", "one alone")
    if table.axis is not None and table.rotate is not None:
        raise fault("rotate", "either rotate, or axis and angle", "both")
    matrix = np.eye(4)
    if table.axis is not None and table.angle is not None:
        length = np.linalg.norm(table.axis)
        if not length > 0:
            raise fault("axis", "a vector other than zero", list(table.axis))
        matrix[:3, :3] = _rotations().from_rotvec(np.radians(table.angle) * np.array(table.axis) / length).as_matrix()
    elif table.rotate is not None:
        matrix[:3, :3] = _rotations().from_euler("xyz", table.rotate, degrees=True).as_matrix()
    if table.scale is not None:
        matrix[:3, :3] *= table.scale
        if not np.linalg.det(matrix[:3, :3]):
            raise fault("scale", "numbers that do not vanish together", list(table.scale))
    if table.translate is not None:
        matrix[:3, 3] = table.translate
    return matrix


def _rotations() -> Any:
    """SciPy's class of rotations, which loads for a fifth of a second."""
    from scipy.spatial.transform import Rotation

    return Rotation
