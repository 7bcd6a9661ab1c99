"""Lights of glTF files: candela, ranges, cones and directions as the specification means them."""

from math import cos, degrees, pi, radians, sqrt

import numpy as np
import pytest
from scene_files import read, triangle
from scipy.integrate import quad

from obscurance.raytrace.errors import SceneError
from obscurance.raytrace.lights.sources import PointLight, SpotLight
from obscurance.scenes.description.gltf_scene import spot_exponent

PUNCTUAL = "KHR_lights_punctual"


def with_light(folder, light, **node):
    builder = triangle()
    node = {**node, "extensions": {PUNCTUAL: {"light": 0}}}
    return read(folder, builder, [{"mesh": 0}, node], extensions={PUNCTUAL: {"lights": [light]}}).scene.lights[0]


def test_point_light_in_candela(tmp_path):
    light = with_light(tmp_path, {"type": "point", "intensity": 10, "color": [1, 0.5, 0]}, translation=[1, 2, 3])
    assert light == PointLight(position=(1, 2, 3), intensity=(10, 5, 0))


def test_the_range_of_a_light(tmp_path):
    assert with_light(tmp_path, {"type": "point", "range": 4}) == PointLight(position=(0, 0, 0), range=4)
    assert with_light(tmp_path, {"type": "spot", "spot": {}, "range": 2}).range == 2
    with pytest.raises(SceneError, match=r"lights\[0\].range: expected a number in"):
        with_light(tmp_path, {"type": "point", "range": 0})


def test_directional_light_shines_along_the_nodes_minus_z(tmp_path):
    light = with_light(tmp_path, {"type": "directional"}, rotation=[sqrt(0.5), 0, 0, sqrt(0.5)])
    assert light.intensity == (1, 1, 1)
    np.testing.assert_allclose(light.direction, [0, 1, 0], atol=1e-12)


def test_spot_light(tmp_path):
    spot = {"innerConeAngle": 0.3, "outerConeAngle": 0.5}
    light = with_light(tmp_path, {"type": "spot", "intensity": 7, "spot": spot}, translation=[0, 4, 0])
    assert isinstance(light, SpotLight)
    assert light.position == (0, 4, 0)
    assert light.direction == (0, 0, -1)
    assert light.half_angle == degrees(0.5)
    assert light.exponent == spot_exponent(0.3, 0.5)
    assert with_light(tmp_path, {"type": "spot", "spot": {}}).half_angle == 45
    rounded = {"type": "spot", "spot": {"outerConeAngle": 1.5707964}}
    assert with_light(tmp_path, rounded).half_angle == 90


@pytest.mark.parametrize(("inner", "outer"), [(0, 45), (20, 30), (0, 90), (44, 45), (0, 1), (60, 90)])
def test_a_spots_edge_keeps_its_power(inner, outer):
    inner, outer = radians(inner), radians(outer)
    exponent = spot_exponent(inner, outer)

    def gltf(c):
        return min(max((c - cos(outer)) / (cos(inner) - cos(outer)), 0), 1) ** 2

    wanted, _ = quad(gltf, cos(outer), 1, points=[cos(inner)])
    power, _ = quad(lambda c: max(c, 0) ** exponent, max(cos(outer), 0), 1)
    assert power == pytest.approx(wanted, rel=1e-6)


def test_a_hard_edged_spot_has_exponent_zero():
    assert spot_exponent(0.4, 0.4) == 0
    assert spot_exponent(pi / 2, pi / 2) == 0


def test_a_bad_light_is_named(tmp_path):
    with pytest.raises(SceneError, match=rf"scene.glb: extensions.{PUNCTUAL}.lights\[0\].intensity\[0\]: expected"):
        with_light(tmp_path, {"type": "point", "intensity": -1})
    with pytest.raises(SceneError, match=r"lights\[0\].light: expected one of .*, got laser"):
        with_light(tmp_path, {"type": "laser"})
