"""Constant and flat shading: the light is that of a face, δ(p, j) that of each point of it."""

import numpy as np
import pytest
from rendered import sphere, white

from obscurance.raytrace import Mesh
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.lights.sources import PointLight, SpotLight
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Scene
from obscurance.raytrace.settings import Settings

FLOOR = Mesh([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [[0, 1, 2], [0, 2, 3]])
LAMP, CENTRE, RADIUS = np.array([0.8, 0.3, 2.5]), np.array([0.1, -0.2, 0.9]), 0.4
LAMPS = {
    "point": PointLight(position=tuple(LAMP), intensity=10),
    "spot": SpotLight(position=tuple(LAMP), direction=(-0.3, -0.1, -1), half_angle=60, intensity=10),
}


@pytest.mark.parametrize("shading", ["constant", "flat"])
@pytest.mark.parametrize("lamp", LAMPS)
def test_the_shadow_of_a_lamp_lies_where_the_lamp_casts_it(lamp, shading):
    """That of a ball on a floor of two triangles, by the distance of its centre from the way to the lamp."""
    camera, size = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), height=4), 200
    scene = Scene((white(FLOOR), white(sphere(RADIUS, CENTRE, 4))), (LAMPS[lamp],))
    layers = render(scene, camera, Settings(width=size, height=size, samples=1, shading=shading)).layers
    at = (2 * np.arange(size) + 1 - size) * 2 / size
    p = np.stack([*np.meshgrid(at, -at), np.zeros((size, size))], axis=-1)
    way = LAMP - p
    passed = np.linalg.norm(np.cross(CENTRE - p, way), axis=-1) / np.linalg.norm(way, axis=-1)
    floor = layers["object_id"][..., 0] == 1
    inside, outside = floor & (passed < RADIUS - 0.01), floor & (passed > RADIUS + 1e-4)
    assert inside.sum() > 2000
    assert (inside | outside).sum() > 0.97 * floor.sum()
    assert not layers["diffuse"][inside].any()
    above = np.add.outer(p[:, 0, 1], -p[0, :, 0])
    for face in (above > 0.01, above < -0.01):
        lit = layers["diffuse"][outside & face]
        assert lit[0, 0] > 0
        assert (lit == lit[0]).all()
