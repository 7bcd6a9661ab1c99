"""Physics of the reflection models: reciprocity, no more light out than in, exact limits; and how the others fail."""

import numpy as np
import pytest

from benchmarks.models.oren_nayar_integral import reference_orders
from obscurance.raytrace import (
    AshikhminShirley,
    BlinnPhong,
    CookTorrance,
    EllipticalBeckmann,
    Kajiya,
    Lambert,
    OrenNayar,
    Phong,
    PoulinFournier,
    Ward,
)
from obscurance.raytrace.brdf.models.oren_nayar import fitted_orders
from obscurance.raytrace.brdf.reflect import NORMAL as N
from obscurance.raytrace.brdf.reflect import albedo as total_albedo
from obscurance.raytrace.brdf.reflect import asymmetry, directional_albedo, reflect, towards
from obscurance.raytrace.errors import OptionError

MIRROR = {"albedo": 1.0, "k_s": 1.0, "eta": 1e6}  # η = 1e6: F = 1 to 4e-6


def albedo(material, incidence, width=None):
    return directional_albedo(material, incidence, width)[0]


def hemisphere(count, seed):
    rng = np.random.default_rng(seed)
    w = rng.normal(size=(count, 3))
    w[:, 2] = np.abs(w[:, 2])
    return w / np.linalg.norm(w, axis=1)[:, None]


PHYSICAL = [
    Lambert(albedo=0.8),
    CookTorrance(albedo=0.5, k_s=0.6, m=0.2, eta=(1.3, 1.5, 2.4)),
    CookTorrance(albedo=0.5, k_s=0.6, m=0.5, eta=1.5, form="book", colour=(0.9, 0.5, 0.2)),
    CookTorrance(albedo=0.5, k_s=0.6, m=0.4, eta=1.5, distribution="gaussian"),
    CookTorrance(albedo=0.5, k_s=0.6, m=0.2, eta=(0.163, 0.452, 1.431), k=(3.493, 2.262, 1.873)),
    EllipticalBeckmann(albedo=0.5, k_s=0.6, m_parallel=0.1, m_perpendicular=0.6, grain=(1, 2, 0)),
    *(
        Ward(k_d=0.2, k_s=0.6, m_parallel=0.1, m_perpendicular=0.6, grain=(1, 2, 0), form=form)
        for form in ("bounded", "ward", "duer")
    ),
    AshikhminShirley(albedo=0.5, reflectance=0.3, exponent_parallel=9, exponent_perpendicular=300, grain=(1, 2, 0)),
    *(
        Kajiya(height=90, correlation_parallel=4000, correlation_perpendicular=900, grain=(1, 2, 0), form=form)
        for form in ("conserving", "kirchhoff")
    ),
    OrenNayar(albedo=0.9, sigma=0.3),
    OrenNayar(albedo=0.9, sigma=1.2),
]


@pytest.mark.parametrize("material", PHYSICAL, ids=lambda m: m.model)
def test_reciprocity(material):
    assert asymmetry(material) < 1e-6


@pytest.mark.parametrize("material", [Phong(k_d=0.3, k_s=0.6, weight="cosine"), PoulinFournier(k_d=0.4, k_s=0)])
def test_cosine_weight_and_diffuse_cylinders_are_reciprocal(material):
    assert asymmetry(material, 2000) < 1e-6


INCIDENCES = np.radians([0, 20, 40, 60, 75, 85, 89])


@pytest.mark.parametrize("m", [0.05, 0.1, 0.3, 0.6, 1.0])
def test_white_furnace_of_conserving_mirrors(m):
    """F = 1 everywhere, so that only D and G are weighed."""
    beckmann = CookTorrance(m=m, **MIRROR)
    for incidence in INCIDENCES:
        assert albedo(beckmann, incidence, width=m) <= 1 + 1e-4
    assert albedo(beckmann, 0.0, width=m) > (0.99 if m <= 0.3 else 0.4)


def test_white_furnace_of_a_conductor():
    """All but its absorption comes back at normal incidence, and no more than the light anywhere."""
    gold = CookTorrance(albedo=0, m=0.05, eta=0.163, k=3.493)
    normal = (0.837**2 + 3.493**2) / (1.163**2 + 3.493**2)
    assert albedo(gold, 0.0, width=0.05) == pytest.approx(normal, rel=2e-3)
    assert gold.gloss().normal[0] == pytest.approx(normal)
    for incidence in INCIDENCES:
        assert albedo(gold, incidence, width=0.05) <= 1 + 1e-4


def test_an_index_below_one_wants_an_extinction():
    with pytest.raises(OptionError, match=r"eta\[1\]: expected a number in \[1, 1e6\] where k is 0, got 0.4"):
        CookTorrance(albedo=0, m=0.2, eta=(1.5, 0.4, 1), k=(0, 0, 3))


@pytest.mark.parametrize("m", [0.1, 0.4, 1.0])
def test_white_furnace_of_gaussian_and_elliptical_mirrors(m):
    gaussian = CookTorrance(m=m, distribution="gaussian", **MIRROR)
    elliptical = EllipticalBeckmann(m_parallel=m / 2, m_perpendicular=m, grain=(1, 0, 0), **MIRROR)
    for incidence in INCIDENCES:
        assert albedo(gaussian, incidence, width=m) <= 1 + 1e-4
        assert albedo(elliptical, incidence, width=m) <= 1 + 1e-4


def test_book_form_reflects_four_times_the_light():
    assert albedo(CookTorrance(m=0.1, form="book", **MIRROR), 0.0, width=0.1) == pytest.approx(4.00, abs=0.01)
    glass = CookTorrance(albedo=0, k_s=1, m=0.1, eta=1.5, form="book")
    assert albedo(glass, np.radians(85), width=0.1) == pytest.approx(1.82, abs=0.05)


def test_oren_nayar_excess_is_at_most_five_percent():
    sigmas = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 1.5]
    worst = max(albedo(OrenNayar(albedo=1, sigma=s), a) for s in sigmas for a in np.radians([0, 60, 80, 87, 89, 89.9]))
    assert 1.04 < worst < 1.05


def test_oren_nayar_with_sigma_zero_is_lambert():
    l, v = hemisphere(1000, 5), hemisphere(1000, 6)
    np.testing.assert_allclose(
        reflect(OrenNayar(albedo=0.7, sigma=0), N, l, v), reflect(Lambert(albedo=0.7), N, l, v), rtol=1e-14
    )


@pytest.mark.parametrize("form", ["conserving", "book"])
def test_equal_slopes_are_isotropic(form):
    l, v = hemisphere(1000, 5), hemisphere(1000, 6)
    shared = {"albedo": 0.5, "k_s": 0.7, "eta": 1.5, "form": form}
    elliptical = EllipticalBeckmann(m_parallel=0.3, m_perpendicular=0.3, grain=(1, 2, 3), **shared)
    np.testing.assert_allclose(
        reflect(elliptical, N, l, v), reflect(CookTorrance(m=0.3, **shared), N, l, v), rtol=1e-10
    )


def test_flat_cylinders_are_blinn_phong():
    l, v = hemisphere(1000, 5), hemisphere(1000, 6)
    paint = {"k_d": 0.3, "k_s": 0.5, "exponent": 12.0}
    flat = reflect(PoulinFournier(floor=1, spacing=3, **paint), N, l, v)
    np.testing.assert_allclose(flat, reflect(BlinnPhong(**paint), N, l, v), rtol=1e-12)


def fit_errors(sigma, angles, order=48):
    """Errors of the fit's A and B relative to n·l, and of A + .9 B, over a grid of angles in degrees."""
    first, second = [], []
    for theta_i in np.radians(angles):
        for theta_r in np.radians(angles):
            for phi in np.linspace(0, np.pi, 5):
                l, v = towards(theta_i), towards(theta_r, phi)
                exact, fit = (reference_orders(sigma, l, v, order), fitted_orders(sigma, tuple(N), tuple(l), tuple(v)))
                first.append((fit[0] - exact[0]) / l[2])
                second.append((fit[1] - exact[1]) / l[2])
    return np.array(first), np.array(second)


@pytest.mark.parametrize("sigma", [0.2, 0.5, 1.0])
def test_oren_nayar_fit_against_the_integral(sigma):
    """To 75° within .2 anywhere and .06 RMS of a value near 1."""
    first, second = fit_errors(sigma, [5, 30, 55, 75], order=32)
    total = first + 0.9 * second
    assert np.sqrt(np.mean(total**2)) < 0.06
    assert np.abs(total).max() < 0.2
    assert np.sqrt(np.mean(second**2)) < 0.05


def test_two_sided_material_is_lit_from_below():
    l, v = towards(0.4), towards(0.8, 1.0)
    for two_sided, expected in ((True, 0.7 / np.pi * l[2]), (False, 0)):
        assert reflect(Lambert(albedo=0.7, two_sided=two_sided), N, -l, v)[0] == pytest.approx(expected)
    one, two = Phong(k_d=0.5, k_s=0.5), Phong(k_d=0.5, k_s=0.5, two_sided=True)
    np.testing.assert_allclose(reflect(two, N, -l, -v), reflect(one, -N, -l, -v))


def test_an_opaque_sheet_reflects_on_the_viewer_s_side():
    l, v = towards(0.4), towards(0.8, 1.0)
    one, sheet = Phong(k_d=0.5, k_s=0.5), Phong(k_d=0.5, k_s=0.5, two_sided="viewer")
    np.testing.assert_array_equal(reflect(sheet, N, l, v), reflect(one, N, l, v))
    np.testing.assert_allclose(reflect(sheet, N, -l, -v), reflect(one, -N, -l, -v))
    assert not reflect(sheet, N, -l, v).any()
    assert not reflect(sheet, N, l, -v).any()
    with pytest.raises(OptionError, match='Phong: two_sided: expected true, false or "viewer", got both'):
        Phong(k_d=0.5, two_sided="both")


ORDER = 384  # narrow highlights of empirical models want many points


@pytest.mark.parametrize("angle", [0.0, 0.7, 1.5])
def test_albedo_of_what_is_known(angle):
    """As docs/models/README.md measures it."""
    np.testing.assert_allclose(total_albedo(Lambert(albedo=(0.2, 0.5, 1)), angle), [0.2, 0.5, 1], rtol=1e-9)
    np.testing.assert_allclose(total_albedo(Phong(k_d=0.6), angle) / np.pi, 0.6, rtol=1e-9)
    mixed = CookTorrance(albedo=0.4, k_s=0.5, m=0.5, eta=1.5)
    exact = directional_albedo(mixed, angle, order=400)
    np.testing.assert_allclose(total_albedo(mixed, angle, ORDER), exact, rtol=2e-3)
    mirror = CookTorrance(albedo=0, k_s=1, m=1e-4, eta=1e6)
    np.testing.assert_allclose(total_albedo(mirror, min(angle, 1.0), ORDER), 1, rtol=1e-4)


def test_black_is_reciprocal():
    assert asymmetry(Lambert(albedo=0)) == 0
