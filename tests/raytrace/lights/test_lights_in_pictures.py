"""Lights in pictures: ranges at any scale of the scene, and colours of a light for each term."""

from math import pi

import numpy as np
import pytest

from raytrace import Lambert, Phong
from raytrace.camera import Camera
from raytrace.lights.sources import (
    AmbientLight,
    DirectionalLight,
    PointLight,
    SpotLight,
)
from raytrace.mesh.mesh import Mesh
from raytrace.renderer.render import render
from raytrace.scene import Object, Scene, Shape
from raytrace.settings import Settings
from scenes.geometry.primitives import plane

ORIGIN = (0.0, 0.0, 0.0)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e5])
def test_a_range_is_kept_at_any_scale_of_the_scene(size):
    floor = Object(Shape(plane((-size, -size, 0), (2 * size, 0, 0), (0, 2 * size, 0), size).mesh, Lambert(albedo=1)))
    camera = Camera((0, 0, size), ORIGIN, up=(0, 1, 0), field_of_view=1)
    once = Settings(width=1, height=1, samples=1, obscurance="off")
    for reach in (2.0, 0.5, 0.49):
        lamp = PointLight(position=(0, 0, 0.5 * size), intensity=size**2, range=reach * size)
        seen = render(Scene((floor,), (lamp,)), camera, once).layers["diffuse"][0, 0]
        np.testing.assert_allclose(seen, max(0, 1 - (0.5 / reach) ** 4) * 4 / pi, rtol=1e-3)


COLOURS = {"ambient": (0.1, 0.2, 0.3), "diffuse": (2, 0, 1), "specular": (0, 3, 1.5)}


@pytest.mark.parametrize(
    ("light", "attenuation"),
    [
        (PointLight(position=(0, 0, 2), intensity=9, **COLOURS), 1 / 4),
        (PointLight(position=(0, 0, 2), attenuation=(1, 2, 0), **COLOURS), 1 / 5),
        (SpotLight(position=(0, 0, 2), direction=(0, 0.75, -1), half_angle=60, exponent=2, **COLOURS), 0.64 / 4),
        (DirectionalLight(direction=(0, 0, -1), **COLOURS), 1.0),
        (PointLight(position=(0, 0, 1e9), attenuation=(1, 0, 0), **COLOURS), 1.0),
    ],
)
@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
def test_terms_have_the_light_s_colours_for_them(light, attenuation, shading):
    """GL's lights: I_a of all lights, unattenuated, and k_d and k_s times what arrives of each."""
    floor = Mesh([[-1, -1, 0], [1, -1, 0], [0, 2, 0]], [[0, 1, 2]])
    material = Phong(k_a=(0.5, 0.4, 0.2), k_d=(0.3, 0.2, 0.1), k_s=0.6, exponent=1)
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    scene = Scene((Object(Shape(floor, material)),), (light, AmbientLight(intensity=0.05)))
    layers = render(scene, camera, Settings(1, 1, 1, shading=shading)).layers
    np.testing.assert_allclose(layers["ambient"][0, 0], np.multiply(material.k_a, [0.15, 0.25, 0.35]), rtol=1e-6)
    if shading != "gouraud":  # lamps are elsewhere as seen from the vertices
        diffuse, specular = (attenuation * np.array(COLOURS[term]) for term in ("diffuse", "specular"))
        np.testing.assert_allclose(layers["diffuse"][0, 0], material.k_d * diffuse, rtol=1e-5)
        np.testing.assert_allclose(layers["specular"][0, 0], 0.6 * specular, rtol=1e-5)
