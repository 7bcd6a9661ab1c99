"""Kajiya: the series against its sum, the elliptical Beckmann model as the limit, energy with the mirror part."""

import numpy as np
import pytest
import transcription as plain

from obscurance.raytrace import EllipticalBeckmann, Kajiya
from obscurance.raytrace.brdf.models.kajiya import scattered
from obscurance.raytrace.brdf.reflect import NORMAL, directional_albedo, reflect, towards

PERFECT = 1e6  # η = 1e6: F = 1 to 4e-6


@pytest.mark.parametrize("g", [1e-4, 0.01, 0.1, 0.5, 1, 2, 3.7, 5.5, 9, 17, 30, 63, 130, 1000])
def test_the_series_is_right_to_a_ten_thousandth_of_its_largest_value(g):
    t = np.linspace(0, 4.5, 200) ** 2 * (1 + g) / g
    exact = np.array([plain.kirchhoff_series(g, each) for each in t])
    found = -np.expm1(-g) * np.array([scattered(g, each) for each in t])
    assert np.abs(found - exact).max() < 1e-4 * exact.max()
    counts = exact > 1e-3 * exact.max()
    np.testing.assert_allclose(found[counts], exact[counts], rtol=5e-3)


def test_short_waves_are_elliptical_beckmann():
    """The relative difference at the lobe's peak falls as 1/g, 1 % at g = 100."""
    l, v = towards(0.3), towards(0.3, np.pi)
    beckmann = reflect(
        EllipticalBeckmann(albedo=0, m_parallel=0.05, m_perpendicular=0.2, eta=PERFECT, grain=(1, 0, 0)), NORMAL, l, v
    )[0]
    apart = []
    for g in (25, 100, 400, 1600):
        wavelength = 2 * np.pi * 100 * 2 * l[2] / np.sqrt(g)  # of which g is this at σ = 100 nm
        material = Kajiya(
            height=100, correlation_parallel=4000, correlation_perpendicular=1000, eta=PERFECT, grain=(1, 0, 0),
            wavelengths=wavelength,
        )  # fmt: skip
        apart.append(reflect(material, NORMAL, l, v)[0] / beckmann - 1)
    np.testing.assert_allclose(np.multiply(apart, (25, 100, 400, 1600)), 1, atol=0.1)
    assert apart[1] == pytest.approx(0.0102, abs=2e-4)


def furnace(phase, lengths, incidence, form="conserving"):
    """What a perfect conductor scatters and mirrors; phase: kσ, lengths: in wavelengths, of 500 nm."""
    height = phase * 500 / (2 * np.pi)
    parallel, perpendicular = (500 * length for length in lengths)
    material = Kajiya(
        height=height, correlation_parallel=parallel, correlation_perpendicular=perpendicular, eta=PERFECT,
        wavelengths=500, grain=(1, 0, 0), form=form,
    )  # fmt: skip
    slope = max(material.lobe_slope(), 0.2)
    return directional_albedo(material, incidence, slope)[0], np.exp(-((2 * phase * np.cos(incidence)) ** 2))


@pytest.mark.parametrize("lengths", [(1.3, 1.3), (8, 8), (8, 1.3)])
@pytest.mark.parametrize("phase", [0.1, 0.5, 1, 2, 4])
def test_scattered_and_mirrored_light_are_no_more_than_arrives(phase, lengths):
    sums = [sum(furnace(phase, lengths, a)) for a in np.radians([0, 50, 75, 85, 89])]
    assert max(sums) <= 1 + 1e-3
    assert sums[0] > 0.4


def test_the_bare_integral_exceeds_one_towards_grazing():
    assert sum(furnace(4, (4, 4), np.radians(85), "kirchhoff")) == pytest.approx(1.41, abs=0.02)
    assert sum(furnace(4, (4, 4), np.radians(85))) < 1
    assert sum(furnace(1, (8, 8), 0.0, "kirchhoff")) == pytest.approx(1, abs=1e-3)
