"""Profiles: w between their half-distances, for every mesh and for closed forms."""

import math

import numpy as np
import pytest
from meshes import crumpled, hills, soup_over_floor

from obscurance import ao
from obscurance.ao import closed_forms
from obscurance.raytrace import Mesh
from obscurance.raytrace.errors import OptionError

HALF_DISTANCES = 0.005 * 2.0 ** np.arange(10)
QUARTERS = np.geomspace(HALF_DISTANCES[0], HALF_DISTANCES[-1], 37)


def _obscured(half_distance, distance):
    return -np.expm1(-math.log(2) * distance / half_distance)


def test_no_mixture_of_distances_errs_by_more_than_004():
    """Errors of mixtures are mixtures of the errors of single distances, so this holds for every mesh."""
    distances = np.append(np.geomspace(1e-6, 1e4, 3000), np.inf)
    profile = ao.Profile(HALF_DISTANCES, _obscured(HALF_DISTANCES, distances[:, None]), 1.0)
    for half_distance in np.geomspace(HALF_DISTANCES[0], HALF_DISTANCES[-1], 145):
        assert np.abs(profile.at(half_distance) - _obscured(half_distance, distances)).max() < 0.0036


@pytest.mark.parametrize("size", [0.004, 0.02, 0.3, 2.0])
@pytest.mark.parametrize(
    "form",
    [
        lambda size, tau: closed_forms.wall(size, tau=tau),
        lambda size, tau: closed_forms.ceiling(size, tau=tau),
        lambda size, tau: closed_forms.inside_sphere(size, tau=tau),
        lambda size, tau: closed_forms.inside_cylinder(size, tau=tau),
    ],
    ids=["plane with wall", "slab", "closed sphere", "closed cylinder"],
)
def test_closed_forms_at_quarter_octaves(form, size):
    values = [[form(size, math.log(2) / each) for each in HALF_DISTANCES]]
    profile = ao.Profile(HALF_DISTANCES, values, 1.0)
    errors = [profile.at(each)[0] - form(size, math.log(2) / each) for each in QUARTERS]
    assert np.abs(errors).max() < 0.003


def test_every_vertex_of_ten_meshes_at_quarter_octaves():
    meshes = [soup_over_floor(seed) for seed in range(5)] + [crumpled(hills(9), 0.1 * seed, seed) for seed in range(5)]
    for vertices, faces in meshes:
        mesh = Mesh(vertices, faces)
        between = [each * mesh.radius for number, each in enumerate(QUARTERS) if number % 4]
        asked = [ao.Exponential(half_distance=each) for each in between]
        baked = ao.bake(mesh, asked, samples=16, denoise=False, profile=True)
        found = np.stack([baked.profile.at(each) for each in between], axis=1)
        assert np.abs(found - baked.values).max() < 0.004
        assert np.ptp(baked.values) > 0.1


@pytest.mark.parametrize("form", [ao.Exponential, ao.Binary, ao.Linear])
def test_a_profile_ends_where_the_falloff_does(form):
    mesh = Mesh(*soup_over_floor(3))
    lengths = [0.05 * mesh.radius, 0.31 * mesh.radius]
    limited = [ao.Exponential(half_distance=each, max_distance="40%") for each in lengths]
    options = {"samples": 16, "denoise": False}
    profile = ao.bake(mesh, form(max_distance="40%"), profile=True, **options).profile
    asked = ao.bake(mesh, limited, **options).values
    assert math.isclose(profile.max_distance, 0.4 * mesh.radius)
    assert np.abs(np.stack([profile.at(each) for each in lengths], axis=1) - asked).max() < 0.004
    without = ao.bake(mesh, profile=True, **options).profile
    assert np.abs(profile.values - without.values).max() > 0.1


def test_columns_and_open_places_are_met_exactly():
    values = np.random.default_rng(1).random((3, 4, 10), np.float32)
    values[0] = 1
    profile = ao.Profile(HALF_DISTANCES, values, 2.0)
    for column, half_distance in enumerate(HALF_DISTANCES):
        assert np.allclose(profile.at(half_distance), values[..., column], rtol=0, atol=1e-6)
    assert np.allclose(profile.at("0.9%"), profile.at(0.018), rtol=0, atol=1e-12)
    assert np.allclose([profile.at(each)[0] for each in QUARTERS], 1, rtol=0, atol=1e-12)


@pytest.mark.parametrize("half_distance", [0.00499, 2.57, "0.4%", "260%"])
def test_a_half_distance_outside_is_an_error_that_says_the_range(half_distance):
    profile = ao.Profile(HALF_DISTANCES, np.ones((2, 10)), 1.0)
    with pytest.raises(OptionError) as fault:
        profile.at(half_distance)
    assert fault.value.field == "half_distance"
    assert "0.005 to 2.56 (0.5 to 256 % of the radius)" in fault.value.expected


@pytest.mark.parametrize("half_distance", [0, -1, math.nan, math.inf, "x", None])
def test_a_half_distance_that_is_no_length(half_distance):
    with pytest.raises(OptionError):
        ao.Profile(HALF_DISTANCES, np.ones((2, 10)), 1.0).at(half_distance)


@pytest.mark.parametrize(
    ("half_distances", "values", "field"),
    [
        ([1, 1], np.ones((3, 2)), "half_distances"),
        ([2, 1], np.ones((3, 2)), "half_distances"),
        ([0, 1], np.ones((3, 2)), "half_distances"),
        ([1, math.inf], np.ones((3, 2)), "half_distances"),
        ([], np.ones((3, 0)), "half_distances"),
        ([1, 2], np.ones((3, 3)), "values"),
        ([1, 2], np.ones(2), "values"),
        ([1, 2], np.full((3, 2), 1.1), "values"),
        ([1, 2], np.full((3, 2), math.nan), "values"),
    ],
)
def test_profiles_that_are_none(half_distances, values, field):
    with pytest.raises(OptionError) as fault:
        ao.Profile(half_distances, values, 1.0)
    assert fault.value.field == field
