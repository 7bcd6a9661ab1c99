"""Albedo and reciprocity of materials, as docs/models/README.md measures them."""

import numpy as np
import pytest

from obscurance.raytrace import CookTorrance, Lambert, Phong
from obscurance.raytrace.brdf.reflect import albedo, asymmetry, directional_albedo

ORDER = 384  # narrow highlights of empirical models want many points


@pytest.mark.parametrize("angle", [0.0, 0.7, 1.5])
def test_albedo_of_what_is_known(angle):
    np.testing.assert_allclose(albedo(Lambert(albedo=(0.2, 0.5, 1)), angle), [0.2, 0.5, 1], rtol=1e-9)
    np.testing.assert_allclose(albedo(Phong(k_d=0.6), angle) / np.pi, 0.6, rtol=1e-9)
    mixed = CookTorrance(albedo=0.4, k_s=0.5, m=0.5, eta=1.5)
    exact = directional_albedo(mixed, angle, order=400)
    np.testing.assert_allclose(albedo(mixed, angle, ORDER), exact, rtol=2e-3)
    mirror = CookTorrance(albedo=0, k_s=1, m=1e-4, eta=1e6)
    np.testing.assert_allclose(albedo(mirror, min(angle, 1.0), ORDER), 1, rtol=1e-4)


def test_black_is_reciprocal():
    assert asymmetry(Lambert(albedo=0)) == 0
