"""Lights in pictures: ranges at any scale of the scene, and colours of a light for each term."""

from math import pi

import numpy as np
import pytest

from obscurance.raytrace import Lambert, Phong
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.lights.sources import (
    AmbientLight,
    DirectionalLight,
    PointLight,
    SpotLight,
)
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings
from obscurance.scenes.geometry.primitives import plane

ORIGIN = (0.0, 0.0, 0.0)


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


WALL = Mesh([[1, -50, -5], [1, 50, -5], [1, 50, 1], [1, -50, 1]], [[0, 1, 2], [0, 2, 3]])  # its upper edge at z = 1
SIDE = 32


def shadow_of_a_wall(light, threads=None, **settings):
    """δ on a floor behind a wall, seen from above, over x from −2.5 to .5 and y from −1.5 to 1.5."""
    floor = plane((-9, -9, 0), (10, 0, 0), (0, 18, 0), 20).mesh
    items = tuple(Object(Shape(mesh, Lambert(albedo=1))) for mesh in (floor, WALL))
    camera = Camera((-1, 0, 9), (-1, 0, 0), up=(0, 1, 0), height=3)
    given = {"width": SIDE, "height": SIDE, "samples": 256, "obscurance": "off", **settings}
    return render(Scene(items, (light,)), camera, Settings(**given), threads=threads).layers["shadow"][..., 0]


def part_of_disc(point, centre, radius):
    """What the wall leaves of a disc that faces the point: a circular segment, cut by the plane of point and edge."""
    way = np.subtract(centre, point)
    across = np.cross(np.subtract((1, 0, 1), point), (0.0, 1.0, 0.0))  # normal of that plane, upwards
    height = way @ across / np.linalg.norm(across)
    t = np.clip(height / np.sqrt(1 - height**2 / (way @ way)) / radius, -1, 1)
    return 0.5 + (np.arcsin(t) + t * np.sqrt(1 - t * t)) / pi


@pytest.mark.parametrize("distance", [1.0, 1e9])
def test_a_penumbra_is_a_circular_segment(distance):
    """Of lamps nearby, a directional light, and one so far away that it is made directional."""
    way = distance * np.array([4, 0, 2.5])
    radius = 0.6 * distance
    lamps = [PointLight(position=tuple(way), radius=radius, attenuation=(1, 0, 0))]
    lamps.append(
        SpotLight(position=tuple(way), direction=tuple(-way), half_angle=80, radius=radius, attenuation=(1, 0, 0))
    )
    if distance > 1:
        angle = 2 * np.degrees(np.arctan(0.6 / np.hypot(4, 2.5)))
        lamps.append(DirectionalLight(direction=tuple(-way), angle=angle))
    x = -1 + 3 * ((np.arange(SIDE) + 0.5) / SIDE - 0.5)
    expected = np.array([[part_of_disc((a, -b, 0), way, radius) for a in x] for b in x + 1])
    assert expected.min() < 0.01
    assert expected.max() > 0.99
    for lamp in lamps:
        error = shadow_of_a_wall(lamp) - expected
        assert abs(error.mean()) < 1e-3
        assert np.sqrt(np.mean(error**2)) < 0.01
        assert np.abs(error).max() < 0.04


def test_lights_without_extent_are_the_limit_of_small_ones():
    hard = shadow_of_a_wall(PointLight(position=(4, 0, 2.5)), samples=16)
    assert set(np.unique(shadow_of_a_wall(PointLight(position=(4, 0, 2.5)), samples=1))) == {0, 1}
    small = shadow_of_a_wall(PointLight(position=(4, 0, 2.5), radius=1e-6), samples=16)
    np.testing.assert_array_equal(small, hard)
    one = shadow_of_a_wall(PointLight(position=(4, 0, 2.5), radius=0.6), samples=1)  # through the middle of the light
    np.testing.assert_array_equal(one, shadow_of_a_wall(PointLight(position=(4, 0, 2.5)), samples=1))


def test_soft_shadows_are_of_the_seed_and_of_nothing_else():
    lamp = PointLight(position=(4, 0, 2.5), radius=0.6)
    shadow = shadow_of_a_wall(lamp, samples=16)
    np.testing.assert_array_equal(shadow, shadow_of_a_wall(lamp, samples=16, threads=2))
    assert (shadow != shadow_of_a_wall(lamp, samples=16, seed=1)).any()


def test_vertices_have_no_soft_shadows():
    with pytest.raises(OptionError, match="shading: expected another one where a light has a radius or an angle"):
        shadow_of_a_wall(DirectionalLight(direction=(-1, 0, -1), angle=1), shading="gouraud")
