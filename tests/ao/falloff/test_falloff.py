"""μ: its values, its limits, and what it refuses."""

import math
import re

import numpy as np
import pytest
from meshes import hills

from obscurance.ao import Binary, Exponential, Linear, Smooth, Tabulated, bake
from obscurance.ao.mu import attenuation
from obscurance.raytrace import Mesh, OptionError


def test_exponential_is_one_minus_exp():
    mu = Exponential(tau=2.0).resolve(1.0)
    np.testing.assert_allclose(mu([0, 0.5, np.inf]), [0, 1 - math.exp(-1), 1])


def test_half_distance_closes_half():
    assert Exponential(half_distance=3.0).resolve(1.0)(3.0) == pytest.approx(0.5)
    assert Exponential(half_distance="25%").resolve(8.0)(2.0) == pytest.approx(0.5)
    assert Exponential().resolve(8.0)(4.0) == pytest.approx(0.5)


def test_the_limit_is_reached_without_a_jump():
    mu = Exponential(tau=1.5, max_distance="50%").resolve(4.0)
    assert mu.max_distance == 2.0
    np.testing.assert_allclose(mu([2.0 - 1e-12, 2.0, 7.0]), 1)
    assert mu(1.0) == pytest.approx((1 - math.exp(-1.5)) / (1 - math.exp(-3)))


def test_binary_closes_up_to_its_limit():
    np.testing.assert_array_equal(Binary(2.0).resolve(1.0)([0, 1.99, 2.0, np.inf]), [0, 0, 1, 1])


def test_one_rate_only():
    with pytest.raises(OptionError, match="tau and half_distance exclude each other"):
        Exponential(tau=1.0, half_distance=1.0)
    with pytest.raises(OptionError, match="half_distance: expected a finite length"):
        Exponential(half_distance="inf")


def test_linear_and_smooth_attenuation():
    assert Linear("50%").resolve(4.0).max_distance == 2.0
    np.testing.assert_allclose(Linear(2.0).resolve(1.0)([0, 0.5, 2.0, np.inf]), [0, 0.25, 1, 1])
    t = np.linspace(0, 1, 777)
    np.testing.assert_allclose(Smooth(3.0).resolve(1.0)(3 * t), t * t * (3 - 2 * t), atol=1e-6)


def test_a_table_is_linear_between_its_values_and_ends_where_they_reach_one():
    mu = Tabulated([0, 1, 2, 4, 5], [0, 0.5, 0.5, 1, 1]).resolve(1.0)
    assert mu.max_distance == 4.0
    np.testing.assert_allclose(mu([0, 0.5, 1.5, 3, 4, 9]), [0, 0.25, 0.5, 0.75, 1, 1])
    assert Tabulated(np.array([0.0, 2.0]), [0, 1]).resolve(1.0).knots == Linear(2.0).resolve(1.0).knots
    assert Tabulated([0, "10%", "50%"], [0, 0.2, 1]).resolve(4.0).knots == ((0.0, 0.0), (0.4, 0.2), (2.0, 1.0))


TABLES = {
    "values: expected one for each of 2 to 65,536 distances, got 2 for 3": ([0, 1, 2], [0, 1]),
    "values: expected one for each of 2 to 65,536 distances, got 1 for 1": ([0], [0]),
    "distances: expected finite lengths that ascend from 0, got 1 in row 3": ([0, 1, 1], [0, 0.5, 1]),
    "distances: expected finite lengths that ascend from 0, got 1 in row 1": ([1, 2], [0, 1]),
    "distances: expected finite lengths that ascend from 0, got inf in row 2": ([0, math.inf], [0, 1]),
    "distances: expected finite lengths that ascend from 0, got -inf in row 1": ([-math.inf, -math.inf], [0, 1]),
    "values: expected numbers that rise from 0 to 1, or stay, got 0.4 in row 3": ([0, 1, 2, 3], [0, 0.5, 0.4, 1]),
    "values: expected numbers that rise from 0 to 1, or stay, got nan in row 2": ([0, 1, 2], [0, math.nan, 1]),
    "values: expected numbers that rise from 0 to 1, or stay, got 0.1 in row 1": ([0, 1], [0.1, 1]),
    "values: expected 1 at the last distance, got 0.9": ([0, 1], [0, 0.9]),
    "values: expected 1 at the last distance, got 1.5": ([0, 1], [0, 1.5]),
    "distances: expected lengths, such as": ([0, "far"], [0, 1]),
    "distances: expected all in mesh units, or all percentages": ([0, 1, "50%"], [0, 0.5, 1]),
    "values: expected numbers from 0 to 1": ([0, 1], ["a", "b"]),
    "distances: expected a list of numbers": ([[0, 1], [2]], [0, 1]),
}


@pytest.mark.parametrize("message", TABLES)
def test_what_is_no_table_is_refused(message):
    with pytest.raises(OptionError, match=re.escape(message)):
        Tabulated(*TABLES[message])


@pytest.mark.parametrize(
    ("function", "got"),
    [
        (lambda x: 1 - math.exp(-x), "got 0.950213 at distance 3"),
        (lambda x: math.cos(x), "got 1 at distance 0"),
        (lambda x: abs(math.sin(2.5 * math.pi / 3 * x)), "got 0.99"),
        (lambda x: math.nan, "got nan at distance 0"),
        (lambda x: "x", "a number at every distance"),
    ],
)
def test_functions_that_are_no_falloff_are_refused(function, got):
    with pytest.raises(OptionError, match=f"function: expected .*{got}"):
        Tabulated.of(function, 3.0)
    with pytest.raises(OptionError, match="max_distance: expected a finite length"):
        Tabulated.of(lambda x: x, math.inf)


def test_a_function_becomes_a_table_within_its_bound():
    table = Tabulated.of(lambda x: 1 - math.exp(-2 * x), 20.0).resolve(1.0)
    x = np.linspace(0, 20, 9999)
    assert 1e-8 < np.abs(table(x) - (1 - np.exp(-2 * x))).max() < 1.2e-6
    assert Tabulated.of(lambda x: x / 50, "50%").resolve(4.0)(1.0) == pytest.approx(0.5)


HILLS = Mesh(*hills(8))


@pytest.mark.parametrize("options", [{}, {"method": "surface"}])
def test_a_tabulated_falloff_bakes_as_the_one_it_is_made_of(options):
    exponential = Exponential(tau=1.5, max_distance=2.0)
    table = Tabulated.of(lambda x: float(exponential.resolve(1.0)(x)), 2.0)
    expected = bake(HILLS, exponential, samples=64, **options)
    assert 0.1 < expected.w.min() < 0.8
    np.testing.assert_allclose(bake(HILLS, table, samples=64, **options).w, expected.w, atol=1e-5)
    linear = bake(HILLS, Linear(2.0), samples=64, **options).w
    np.testing.assert_array_equal(bake(HILLS, Tabulated([0, 2], [0, 1]), samples=64, **options).w, linear)
    many = np.linspace(0, 2, 1001)
    np.testing.assert_allclose(bake(HILLS, Tabulated(many, many / 2), samples=64, **options).w, linear, atol=1e-12)


def test_only_what_is_nearer_than_where_mu_is_one_counts():
    w = bake(HILLS, Tabulated([0, 0.3, 50], [0, 1, 1]), samples=64).w
    np.testing.assert_array_equal(w, bake(HILLS, Linear(0.3), samples=64).w)


def test_a_hit_beyond_the_limit_by_rounding_is_open():
    """Distances of hits are float32."""
    mu = Tabulated([0, 1 - 1e-12, 1], [0, 0.5, 1]).resolve(1.0).in_render_space(1.0)
    assert attenuation.function(1 + 6e-8, mu) == 1.0
