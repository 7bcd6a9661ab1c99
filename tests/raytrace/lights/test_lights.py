"""Lights: what arrives, and that nothing is skipped which matters."""

from dataclasses import replace
from math import cos, radians, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.lights import kernels as light_rows
from obscurance.raytrace.lights.kernels import cannot_matter_in, incident
from obscurance.raytrace.lights.sources import (
    AmbientLight,
    DirectionalLight,
    EnvironmentLight,
    PointLight,
    SkyLight,
    SpotLight,
    irradiance,
    light_from_dict,
    pack_lights,
)
from obscurance.raytrace.renderer.render_scene import place_lights

ORIGIN = (0.0, 0.0, 0.0)


def left_out_in(light, low, high):
    return cannot_matter_in(*light.pack(), tuple(map(float, low)), tuple(map(float, high)))


def arriving(light, point=ORIGIN):
    l, distance, rgb = incident(*light.pack(), tuple(map(float, point)))
    return np.array(l), distance, np.array(rgb)


def test_point_light_falls_off_with_the_square_of_distance():
    l, distance, rgb = arriving(PointLight(position=(0, 0, 3), intensity=(9, 18, 27)))
    np.testing.assert_allclose(l, [0, 0, 1])
    assert distance == 3
    np.testing.assert_allclose(rgb, [1, 2, 3])


def test_general_attenuation():
    _, _, rgb = arriving(PointLight(position=(0, 2, 0), intensity=22, attenuation=(1, 3, 1)))
    np.testing.assert_allclose(rgb, 22 / (1 + 3 * 2 + 4))


@pytest.mark.parametrize(
    "light",
    [PointLight(position=ORIGIN, range=4), SpotLight(position=ORIGIN, direction=(1, 0, 0), half_angle=57, range=4)],
)
def test_light_ends_at_its_range(light):
    for distance in (1e-3, 1, 2, 3.999):
        rgb = arriving(light, (distance, 0, 0))[2]
        np.testing.assert_allclose(rgb, (1 - (distance / 4) ** 4) / distance**2)
    for distance in (4, 4.001, 1e9):
        assert (arriving(light, (distance, 0, 0))[2] == 0).all()
    assert left_out_in(light, (4.001, -1, -1), (5, 1, 1))
    assert not left_out_in(light, (3.99, -1, -1), (5, 1, 1))


def test_spot_light_within_and_outside_its_cone():
    spot = SpotLight(
        position=ORIGIN, direction=(0, 0, 2), half_angle=30, exponent=3, attenuation=(1, 0, 0), intensity=5
    )
    for degrees in (0, 10, 29.99):
        a = radians(degrees)
        np.testing.assert_allclose(arriving(spot, (4 * sin(a), 0, 4 * cos(a)))[2], 5 * cos(a) ** 3)
    for degrees in (30.01, 90, 180):
        a = radians(degrees)
        assert (arriving(spot, (4 * sin(a), 0, 4 * cos(a)))[2] == 0).all()


def test_at_the_light_itself_everything_is_finite():
    for light in (PointLight(position=ORIGIN), SpotLight(position=ORIGIN, direction=(1, 0, 0), half_angle=29)):
        for point in (ORIGIN, (1e-160, 0, 0), (1e-20, 0, 0)):
            l, distance, rgb = arriving(light, point)
            assert np.isfinite([*l, distance, *rgb]).all()


def test_photometry_law():
    n, l = np.array([0, 0, 1.0]), np.array([0, 0.6, 0.8])
    assert irradiance(100, n, l, 5) == pytest.approx(100 * 0.8 / 25)
    assert irradiance(100, n, -l, 5) == 0
    assert irradiance([1, 2], n, np.array([l, n]), [1, 2]).tolist() == pytest.approx([0.8, 0.5])
    assert irradiance(100, 7 * n, 0.01 * l, 5) == pytest.approx(100 * 0.8 / 25)  # of any length
    assert irradiance(100, 0 * n, l, 5) == 0
    with pytest.raises(OptionError, match="irradiance: l: expected finite numbers"):
        irradiance(1, n, [0, np.nan, 1], 1)


def test_a_light_without_colours_of_its_own_has_its_intensity_s():
    light = PointLight(position=(1, 2, 3), intensity=(0.1, 0, 0.7))
    given = replace(light, ambient=0, diffuse=light.intensity, specular=light.intensity)
    np.testing.assert_array_equal(light.pack()[1], given.pack()[1])
    assert (light.pack()[1][light_rows.DIFFUSE :] == 1).all()
    made = light_from_dict({"light": "point", "position": [1, 2, 3], "ambient": 0.1, "specular": [0, 0, 1]})
    assert (made.ambient, made.diffuse, made.specular) == ((0.1, 0.1, 0.1), None, (0, 0, 1))
    with pytest.raises(OptionError, match="diffuse"):
        PointLight(position=(1, 2, 3), diffuse=-1)
    with pytest.raises(OptionError, match="diffuse"):
        light_from_dict({"light": "ambient", "diffuse": 1})


coordinate = st.floats(-10, 10)
vectors = st.tuples(coordinate, coordinate, coordinate)
directions = vectors.filter(lambda a: np.linalg.norm(a) > 1e-3)
positive = st.floats(0, 100)
locals_ = {"position": vectors, "intensity": positive, "attenuation": st.sampled_from(
    [(0, 0, 1), (1, 0, 0), (1, 0.5, 0.1), (0, 1, 0)]), "range": st.none() | st.floats(0.01, 30)}  # fmt: skip
lights = st.one_of(
    st.builds(PointLight, **locals_),
    st.builds(SpotLight, direction=directions, half_angle=st.floats(0.5, 90), exponent=st.floats(0, 50), **locals_),
    st.builds(DirectionalLight, direction=directions, intensity=positive),
    st.builds(AmbientLight, intensity=positive),
)


@settings(deadline=None, max_examples=600, derandomize=True)
@given(lights, vectors, st.tuples(*[st.floats(0, 5)] * 3), st.integers(0, 1000))
def test_to_no_point_of_a_skipped_box_a_light_brings_anything(light, low, size, seed):
    high = tuple(a + b for a, b in zip(low, size, strict=True))
    if not left_out_in(light, low, high):
        return
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    for at in np.vstack([corners, np.random.default_rng(seed).random((20, 3))]):
        _, _, rgb = arriving(light, tuple(np.array(low) + at * size))
        assert rgb.max() == 0


def test_boxes_are_skipped_out_of_range_and_out_of_the_cone():
    lamp = PointLight(position=ORIGIN, intensity=1, range=20)
    assert left_out_in(lamp, (21, 0, 0), (22, 1, 1))
    assert not left_out_in(lamp, (19, 0, 0), (21, 1, 1))
    assert not left_out_in(PointLight(position=ORIGIN, intensity=1), (100, 0, 0), (101, 1, 1))
    spot = SpotLight(position=ORIGIN, direction=(1, 0, 0), half_angle=17.2)
    assert left_out_in(spot, (-3, -1, -1), (-2, 1, 1))
    assert left_out_in(spot, (2, 2, -1), (3, 3, 1))
    assert not left_out_in(spot, (2, -1, -1), (3, 1, 1))
    assert not left_out_in(spot, (-1, -1, -1), (1, 1, 1))
    assert not left_out_in(DirectionalLight(direction=(0, 0, -1)), (0, 0, 0), (1, 1, 1))
    for dark in (AmbientLight(intensity=0), PointLight(position=ORIGIN, intensity=0)):
        assert left_out_in(dark, (0, 0, 0), (1, 1, 1))


@pytest.mark.parametrize(
    ("make", "field", "expected"),
    [
        (lambda: PointLight(position=(0, 0, float("inf"))), "position[2]", "finite"),
        (lambda: PointLight(position=ORIGIN, intensity=-1), "intensity[0]", "[0, inf)"),
        (lambda: PointLight(position=ORIGIN, range=0), "range", "[1e-100, 1e100]"),
        (lambda: PointLight(position=ORIGIN, attenuation=(0, 0, 0)), "attenuation", "not all zero"),
        (lambda: DirectionalLight(direction=ORIGIN), "direction", "other than zero"),
        (lambda: SpotLight(position=ORIGIN, direction=(1, 0, 0), half_angle=91), "half_angle", "(0, 90]"),
        (lambda: light_from_dict({"light": "laser"}), "light", "spot"),
    ],
)
def test_a_wrong_value_is_named(make, field, expected):
    with pytest.raises(OptionError) as caught:
        make()
    assert caught.value.field == field
    assert expected in caught.value.expected


def test_round_trip_and_packing():
    some = [
        PointLight(position=(1, 2, 3)),
        SpotLight(position=(1, 2, 3), direction=(1, 0, 0), half_angle=29, exponent=2, range=7),
        DirectionalLight(direction=(1, 0, 0), intensity=(1, 2, 3)),
        AmbientLight(intensity=0.5),
    ]
    around = [SkyLight(zenith=1, horizon=(1, 2, 3), up=(0, 1, 0)), EnvironmentLight(image="a/b.hdr", turn=9)]
    for light in around:
        assert light_from_dict(light.to_dict()) == light
    assert [light_from_dict(light.to_dict()) for light in some] == some
    kinds, rows = pack_lights(some)
    assert kinds.tolist() == [0, 2, 1, 3]
    assert rows.shape[0] == 4


def test_lights_at_the_edge_of_infinity_are_directional():
    """Their distance squared is beyond float32, which lit nothing; half-way there nothing is changed."""
    lights = [
        PointLight(position=(3e30, 0, 4e30), intensity=(25e60, 0, 1e60)),
        SpotLight(position=(0, 0, 1e9), direction=(0, 0, -1), half_angle=17.2, intensity=1e18, range=1e10),
        SpotLight(position=(0, 0, 1e9), direction=(0, 0, 1), half_angle=17.2),
        PointLight(position=(0, 1e6, 0)),
    ]
    kinds, rows, *_ = place_lights(tuple(lights), np.zeros(3), 1.0)
    assert kinds.tolist() == [light_rows.DIRECTIONAL] * 2 + [light_rows.POINT]  # the one that shines away is black
    found = [incident(int(kind), row, (0.1, 0.2, 0.3)) for kind, row in zip(kinds, rows, strict=True)]
    np.testing.assert_allclose(found[0][0], (0.6, 0, 0.8), atol=1e-12)
    np.testing.assert_allclose(found[0][2], (1, 0, 0.04), rtol=1e-12)
    np.testing.assert_allclose(found[1][2], (0.9999,) * 3, rtol=1e-12)
    np.testing.assert_array_equal(rows[2], lights[3].pack()[1])
