"""Rotations against SciPy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from obscurance.scenes.geometry.instances import rotation_about, rotation_about_axes, rotation_of_quaternion

RANDOM = np.random.default_rng(1).normal(size=(50, 4))


@pytest.mark.parametrize("given", RANDOM)
def test_rotations_are_scipys(given):
    np.testing.assert_allclose(rotation_of_quaternion(given), Rotation.from_quat(given).as_matrix(), atol=1e-15)
    axis = given[:3]
    degrees = 200.0 * given[3]
    turned = Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis))
    np.testing.assert_allclose(rotation_about(axis, degrees), turned.as_matrix(), atol=1e-14)
    angles = 90 * axis
    np.testing.assert_allclose(
        rotation_about_axes(angles), Rotation.from_euler("xyz", angles, degrees=True).as_matrix(), atol=1e-14
    )


def test_a_quaternion_of_length_zero_is_refused():
    with pytest.raises(ValueError, match="length zero"):
        rotation_of_quaternion([0.0, 0.0, 0.0, 0.0])
