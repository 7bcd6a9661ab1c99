"""SIMD lanes of the renderer against `reflect`: pictures of a ball, whose points' normals are a layer of them."""

import numpy as np
import pytest

from obscurance.raytrace import (
    AshikhminShirley,
    BlinnPhong,
    Camera,
    DirectionalLight,
    EllipticalBeckmann,
    Kajiya,
    Object,
    PointLight,
    Scene,
    Settings,
    Shape,
    Ward,
    Warnock,
    reflect,
    render,
)
from obscurance.scenes.geometry.primitives import sphere

GRAIN = (0.3, 0.2, 1.0)
TO_VIEWER, TO_LIGHT = np.array([0, -1.0, 0]), np.array([-0.5, -0.4, 0.6])
SHINING = [
    BlinnPhong(k_d=0.2, k_s=0.5, exponent=40),
    BlinnPhong(k_d=0.2, k_s=0.5, exponent=40, weight=(0.2, 0.1, -0.3, 0.9)),
    EllipticalBeckmann(albedo=0.4, k_s=0.6, m_parallel=0.1, m_perpendicular=0.5, grain=GRAIN),
    *(
        Ward(k_d=(0.1, 0.2, 0.3), k_s=0.4, m_parallel=0.1, m_perpendicular=0.5, grain=GRAIN, form=form)
        for form in ("bounded", "ward", "duer")
    ),
    Kajiya(height=90, correlation_parallel=4000, correlation_perpendicular=900, grain=GRAIN),
    AshikhminShirley(
        albedo=0.3, reflectance=(0.1, 0.5, 0.9), exponent_parallel=9, exponent_perpendicular=200, grain=GRAIN
    ),
]


@pytest.mark.parametrize("material", SHINING, ids=lambda m: f"{m.model} {getattr(m, 'form', '')}")
def test_a_picture_shows_what_reflect_says(material):
    item = Object(Shape(sphere(0.5, 0.05).mesh, material))
    scene = Scene((item,), (DirectionalLight(direction=tuple(-TO_LIGHT), intensity=1),))
    settings = Settings(width=40, height=40, samples=1, shadows=False)
    layers = render(scene, Camera(tuple(3 * TO_VIEWER), (0, 0, 0), height=1), settings).layers
    normals = layers["normal"].reshape(-1, 3).astype(float)
    expected = reflect(material, normals, TO_LIGHT, TO_VIEWER)
    shown = (layers["diffuse"] + layers["specular"]).reshape(-1, 3)
    assert expected.max() > 0.05
    np.testing.assert_allclose(shown, expected, rtol=1e-3, atol=1e-5 * expected.max())


def test_warnock_shows_depth():
    """A lamp at the viewer: 4/d at the distance d, whichever way the surface faces."""
    item = Object(Shape(sphere(0.5, 0.05).mesh, Warnock(albedo=(0.2, 0.4, 0.8))))
    viewer = tuple(3 * TO_VIEWER)
    lamp = PointLight(position=viewer, intensity=4, attenuation=(0, 1, 0))
    camera = Camera(viewer, (0, 0, 0), field_of_view=20)
    layers = render(Scene((item,), (lamp,)), camera, Settings(width=40, height=40, samples=1, shadows=False)).layers
    depth = layers["depth"][..., 0]
    hit = np.isfinite(depth)
    assert np.ptp(depth[hit]) > 0.4
    np.testing.assert_allclose(layers["diffuse"][hit], 4 / depth[hit, None] * (0.2, 0.4, 0.8), rtol=1e-5)
    assert not layers["specular"].any()
