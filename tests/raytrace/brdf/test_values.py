"""Numbers the textbook works out, and every kernel against its formula written a second time."""

import numpy as np
import pytest
import transcription as plain

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
    Strauss,
    Ward,
    Warnock,
)
from obscurance.raytrace.brdf.microfacet import conductor_fresnel, fresnel
from obscurance.raytrace.brdf.models.cook_torrance import gaussian_constant
from obscurance.raytrace.brdf.reflect import reflect
from obscurance.raytrace.errors import OptionError

GRAIN = np.array([0.3, 0.9, -0.2])


def directions(count, seed):
    """Normals, and directions to light and viewer at or above the horizon they define."""
    rng = np.random.default_rng(seed)
    n, l, v = (a / np.linalg.norm(a, axis=1)[:, None] for a in rng.normal(size=(3, count, 3)))
    return n, *(w * np.sign(np.sum(w * n, axis=1))[:, None] for w in (l, v))


@pytest.mark.parametrize(("eta", "k"), [(0.163, 3.493), (1.431, 1.873), (0.01, 1e-3), (2.4, 1e-5), (1e6, 1e6), (1, 1)])
def test_conductor_fresnel(eta, k):
    for cosine in (0.0, 1e-3, 0.1, 0.5, 0.9, 1.0):
        expected = plain.conductor_fresnel(eta, k, cosine)
        assert conductor_fresnel(eta, k, cosine) == pytest.approx(expected, rel=1e-9)
    assert conductor_fresnel(eta, k, 0.0) == 1.0
    normal = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
    assert conductor_fresnel(eta, k, 1.0) == pytest.approx(normal, rel=1e-12)


@pytest.mark.parametrize(("name", "coefficients"), [("one", [1]), ("cosine", np.array([0, 1]))])
def test_named_weights_are_polynomials(name, coefficients):
    named = Phong(k_d=0.3, k_s=0.6, weight=name)
    given = Phong(k_d=0.3, k_s=0.6, weight=coefficients)
    assert given.pack().row.tolist() == named.pack().row.tolist()
    assert given.to_dict()["weight"] == list(coefficients)


@pytest.mark.parametrize(
    "weight", ["two", 1, [], [1] * 7, [0, 1.001], [0.1, -0.2], ["1"], [[1]], [float("nan")], [True]]
)
def test_a_weight_is_a_share(weight):
    with pytest.raises(OptionError, match=r"Phong: weight: expected .*up to six coefficients"):
        Phong(k_d=0.3, weight=weight)


def test_conductor_fresnel_tends_to_the_dielectric_s():
    for cosine in (0.0, 0.3, 1.0):
        assert conductor_fresnel(1.5, 2e-6, cosine) == pytest.approx(fresnel(1.5, cosine), rel=1e-9)


ETA = np.array([1.3, 1.5, 2.4])
GOLD = {"eta": (0.163, 0.452, 1.431), "k": (3.493, 2.262, 1.873)}
GLASS = (1.0, -4.8, 9.6, -9.6, 4.8, -0.96)  # of .04 + .96 (1 − cosθ)⁵
COLOUR = np.array([0.9, 0.6, 0.2])
MODELS = {
    "lambert": (Lambert(albedo=0.7), lambda n, l, v, g: plain.lambert(0.7, n, l, v)),
    "warnock": (Warnock(albedo=0.7), lambda n, l, v, g: 0.7 if n @ l > 0 else 0.0),
    "phong": (Phong(k_d=0.3, k_s=0.6, exponent=7.5), lambda n, l, v, g: plain.phong(0.3, 0.6, 7.5, n, l, v)),
    "phong, W = cosine": (
        Phong(k_d=0.3, k_s=0.6, exponent=7.5, weight="cosine"),
        lambda n, l, v, g: plain.phong(0.3, 0.6, 7.5, n, l, v, weight=lambda cosine: cosine),
    ),
    "blinn, W of one's own": (
        BlinnPhong(k_d=0.3, k_s=0.6, exponent=7.5, weight=GLASS),
        lambda n, l, v, g: plain.phong(
            0.3, 0.6, 7.5, n, l, v, True, weight=lambda cosine: 0.04 + 0.96 * (1 - cosine) ** 5
        ),
    ),
    "blinn": (
        BlinnPhong(k_d=0.3, k_s=0.6, exponent=40),
        lambda n, l, v, g: plain.phong(0.3, 0.6, 40, n, l, v, halfway=True),
    ),
    "cook_torrance": (
        CookTorrance(albedo=0.4, k_s=0.7, m=0.3, eta=tuple(ETA)),
        lambda n, l, v, g: plain.cook_torrance(0.4, 0.7, ETA, n, l, v, plain.beckmann(n, 0.3)),
    ),
    "cook_torrance, book": (
        CookTorrance(albedo=0.4, k_s=0.7, m=0.3, eta=tuple(ETA), form="book"),
        lambda n, l, v, g: plain.cook_torrance(0.4, 0.7, ETA, n, l, v, plain.beckmann(n, 0.3), book=True),
    ),
    "cook_torrance, shifted colour": (
        CookTorrance(albedo=0.4, k_s=0.7, m=0.3, eta=tuple(ETA), colour=tuple(COLOUR)),
        lambda n, l, v, g: plain.cook_torrance(0.4, 0.7, ETA, n, l, v, plain.beckmann(n, 0.3), colour=COLOUR),
    ),
    "cook_torrance, gold": (
        CookTorrance(albedo=0.4, k_s=0.7, m=0.3, **GOLD),
        lambda n, l, v, g: plain.cook_torrance(0.4, 0.7, GOLD["eta"], n, l, v, plain.beckmann(n, 0.3), k=GOLD["k"]),
    ),
    "cook_torrance, gold of shifted colour": (
        CookTorrance(albedo=0.4, k_s=0.7, m=0.3, colour=tuple(COLOUR), **GOLD),
        lambda n, l, v, g: plain.cook_torrance(
            0.4, 0.7, GOLD["eta"], n, l, v, plain.beckmann(n, 0.3), colour=COLOUR, k=GOLD["k"]
        ),
    ),
    "cook_torrance, Gaussian": (
        CookTorrance(albedo=0.4, k_s=0.7, m=0.3, eta=tuple(ETA), distribution="gaussian", gaussian_c=2.0),
        lambda n, l, v, g: plain.cook_torrance(0.4, 0.7, ETA, n, l, v, plain.gaussian(n, 0.3, 2.0)),
    ),
    "elliptical_beckmann": (
        EllipticalBeckmann(
            albedo=0.4, k_s=0.7, m_parallel=0.1, m_perpendicular=0.5, eta=tuple(ETA), grain=tuple(GRAIN)
        ),
        lambda n, l, v, g: plain.cook_torrance(0.4, 0.7, ETA, n, l, v, plain.elliptical(n, g, 0.1, 0.5)),
    ),
    **{
        f"ward, {form}": (
            Ward(k_d=0.2, k_s=0.7, m_parallel=0.1, m_perpendicular=0.5, grain=tuple(GRAIN), form=form),
            lambda n, l, v, g, form=form: plain.ward(0.2, 0.7, 0.1, 0.5, n, l, v, g, form),
        )
        for form in ("bounded", "ward", "duer")
    },
    "ashikhmin_shirley": (
        AshikhminShirley(
            albedo=0.4, reflectance=0.2, exponent_parallel=7, exponent_perpendicular=90, grain=tuple(GRAIN)
        ),
        lambda n, l, v, g: plain.ashikhmin_shirley(0.4, 0.2, 7, 90, n, l, v, g),
    ),
    **{
        f"kajiya, {form}": (
            Kajiya(
                height=90,
                correlation_parallel=4000,
                correlation_perpendicular=900,
                grain=tuple(GRAIN),
                wavelengths=(700, 500, 400),
                eta=tuple(ETA),
                form=form,
            ),
            lambda n, l, v, g, form=form: plain.kajiya(90, 4000, 900, (700, 500, 400), ETA, n, l, v, g, form),
        )
        for form in ("conserving", "kirchhoff")
    },
    "oren_nayar": (OrenNayar(albedo=0.8, sigma=0.4), lambda n, l, v, g: plain.oren_nayar(0.8, 0.4, n, l, v)),
    "oren_nayar, rough": (OrenNayar(albedo=0.3, sigma=1.5), lambda n, l, v, g: plain.oren_nayar(0.3, 1.5, n, l, v)),
    "strauss": (
        Strauss(colour=0.4, smoothness=0.6, metalness=0.7, transparency=0.2),
        lambda n, l, v, g: plain.strauss(0.4, 0.6, 0.7, 0.2, n, l, v),
    ),
}


@pytest.mark.parametrize("name", MODELS)
def test_kernel_equals_the_formula(name):
    material, formula = MODELS[name]
    n, l, v = directions(300, 1)
    g = GRAIN - (n @ GRAIN)[:, None] * n
    g /= np.linalg.norm(g, axis=1)[:, None]
    expected = np.array([np.broadcast_to(formula(*args), 3) for args in zip(n, l, v, g, strict=True)])
    rtol, atol = (5e-4, 1e-4 * expected.max()) if name.startswith("kajiya") else (1e-9, 1e-14)  # of its series
    np.testing.assert_allclose(reflect(material, n, l, v), expected, rtol=rtol, atol=atol)
    single = reflect(material, *(a.astype(np.float32) for a in (n, l, v)))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, expected, rtol=max(rtol, 1e-4), atol=max(atol, 1e-6 * expected.max()))


CYLINDERS = [(2, 0, 20), (3, 0, 5), (2.6, 0.4, 60), (1.2, 0, 12.5), (5, 0.8, 1)]


def brute_force_difference(spacing, floor, exponent, pairs, count):
    material = PoulinFournier(k_d=0.5, k_s=0.5, exponent=exponent, spacing=spacing, floor=floor, grain=tuple(GRAIN))
    n, l, v = directions(pairs, 2)
    g = GRAIN - (n @ GRAIN)[:, None] * n
    g /= np.linalg.norm(g, axis=1)[:, None]
    shape = 0.5, 0.5, exponent, spacing, floor
    expected = [plain.cylinders(*shape, *args, count=count) for args in zip(n, l, v, g, strict=True)]
    return np.abs(reflect(material, n, l, v)[:, 0] - expected).max()


@pytest.mark.parametrize("shape", CYLINDERS)
def test_poulin_fournier_equals_brute_force(shape):
    assert brute_force_difference(*shape, pairs=20, count=20_000) < 3e-4


@pytest.mark.slow
@pytest.mark.parametrize("shape", CYLINDERS)
def test_poulin_fournier_equals_brute_force_with_many_samples(shape):
    assert brute_force_difference(*shape, pairs=8, count=500_000) < 5e-6


def test_poulin_fournier_integrals_are_closed():
    """One unshadowed cap, floor hidden: the arc integral by fine quadrature, to the stated 1e-5."""
    exponent, spacing = 33.3, 2.0
    n, g = np.array([0, 0, 1.0]), np.array([0, 1.0, 0])
    b = np.cross(n, g)
    l, v = plain.unit(0.02 * b + 0.3 * g + n), plain.unit(0.01 * b - 0.2 * g + n)
    x = 2 * spacing * ((np.arange(2_000_000) + 0.5) / 2e6 - 0.5)
    x = x[np.abs(x) < 0.5 * spacing]
    facet = x[:, None] * b + np.sqrt(1 - x**2)[:, None] * n
    seen = np.maximum(0, facet @ v) * (facet @ l > 0) / (np.sqrt(1 - x**2) * len(x) * (n @ v))
    material = {"exponent": exponent, "spacing": spacing, "grain": (0, 1, 0)}
    diffuse = reflect(PoulinFournier(k_d=1, k_s=0, **material), n, l, v)[0]
    specular = reflect(PoulinFournier(k_d=0, k_s=1, **material), n, l, v)[0]
    # facets at the very foot, |θ| > 88.8°, are hidden by the neighbour; they carry 2e-4 of the diffuse light
    assert specular == pytest.approx(np.sum(seen * np.maximum(0, facet @ plain.unit(l + v)) ** exponent), rel=1e-5)
    assert diffuse == pytest.approx(np.sum(seen * (facet @ l)), rel=1e-3)


def test_normalised_gaussian_has_beckmann_s_norm():
    for m in (1e-3, 0.1, 0.4, 2.0):
        theta = (np.arange(400_000) + 0.5) / 400_000 * min(np.pi / 2, 10 * m)
        norm = np.sum(np.exp(-((theta / m) ** 2)) * np.sin(2 * theta)) * (theta[1] - theta[0])
        assert gaussian_constant(m) * norm == pytest.approx(1, rel=1e-6)
