"""μ: its values, its limits, and what it refuses."""

import math

import numpy as np
import pytest

from ao import Binary, Exponential
from raytrace import OptionError


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


@pytest.mark.parametrize("length", [0, -1, "0%", "-5%", "far", "", "%", float("nan"), None, "1 m"])
def test_lengths_must_be_above_zero(length):
    with pytest.raises(OptionError, match="max_distance: expected a length above 0"):
        Binary(length)


@pytest.mark.parametrize("tau", [0, -1, math.inf, math.nan, "fast"])
def test_tau_must_be_finite_and_above_zero(tau):
    with pytest.raises(OptionError, match="tau: expected a finite rate above 0"):
        Exponential(tau=tau)


def test_one_rate_only():
    with pytest.raises(OptionError, match="either tau or half_distance"):
        Exponential(tau=1.0, half_distance=1.0)
    with pytest.raises(OptionError, match="half_distance: expected a finite length"):
        Exponential(half_distance="inf")
