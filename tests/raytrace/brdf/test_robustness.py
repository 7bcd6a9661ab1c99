"""No NaN, infinity or negative value, whatever the directions and parameters, in single and double precision."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

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
)
from obscurance.raytrace.brdf.dispatch import reflect_rows
from obscurance.raytrace.brdf.material import pack_materials
from obscurance.raytrace.brdf.reflect import reflect
from obscurance.raytrace.errors import OptionError

TINY, NEARLY_ONE = 1e-6, float(np.nextafter(1.0, 0.0))
EXTREMES = [
    Lambert(albedo=1),
    Lambert(albedo=0),
    *(kind(k_d=0.5, k_s=0.5, exponent=m) for kind in (Phong, BlinnPhong) for m in (1e-6, 1, 1e6)),
    *(
        CookTorrance(albedo=1, k_s=k_s, m=m, eta=eta, form=form, distribution=distribution)
        for k_s in (0, 1)
        for m in (TINY, 0.3, 100)
        for eta in (1, 1.5, 1e6)
        for form in ("conserving", "book")
        for distribution in ("beckmann", "gaussian")
    ),
    CookTorrance(albedo=0, k_s=1, m=0.2, eta=(1, 1.5, 1e6), colour=(0, 0.5, 1)),
    *(
        EllipticalBeckmann(albedo=0.5, k_s=1, m_parallel=a, m_perpendicular=b, grain=(0, 0, 1))
        for a, b in ((TINY, TINY), (TINY, 100), (0.1, 0.5), (100, 100))
    ),
    *(
        Ward(k_d=0.5, k_s=0.5, m_parallel=a, m_perpendicular=b, form=form)
        for a, b in ((TINY, TINY), (TINY, 100), (0.1, 0.5), (100, 100))
        for form in ("bounded", "ward", "duer")
    ),
    *(
        AshikhminShirley(albedo=1, reflectance=r, exponent_parallel=a, exponent_perpendicular=b)
        for r in (0, 0.5, 1)
        for a, b in ((1e-6, 1e-6), (1e-6, 1e6), (10, 1000), (1e6, 1e6))
    ),
    *(
        Kajiya(height=s, correlation_parallel=a, correlation_perpendicular=b, eta=eta, form=form)
        for s, a, b in ((1e-3, 611, 1e7), (50, 700, 2000), (300, 611, 1e7), (5e6, 1e7, 1e7))
        for eta in (1, 1.5, 1e6)
        for form in ("conserving", "kirchhoff")
    ),
    *(OrenNayar(albedo=rho, sigma=sigma) for rho in (0.05, 1) for sigma in (0, 1e-9, 0.6, np.pi / 2)),
    *(
        Strauss(colour=(0, 0.5, 1), smoothness=s, metalness=m, transparency=t)
        for s in (0, 0.5, NEARLY_ONE)
        for m in (0, 1)
        for t in (0, 1)
    ),
    *(
        PoulinFournier(k_d=0.5, k_s=0.5, exponent=m, spacing=d, floor=h, grain=(1, 0, 0))
        for m in (1e-6, 1, 50, 1e6)
        for d in (1e-3, 2, 1e6)
        for h in (0, 0.5, 1)
    ),
]
KINDS, ROWS = pack_materials(EXTREMES)

angles = st.one_of(
    st.floats(0, np.pi),
    st.sampled_from([0.0, np.pi / 2, np.pi]),
    st.sampled_from([1e-16, 1e-12, 1e-7, 1e-3]).map(lambda a: np.pi / 2 - a),
    st.sampled_from([1e-12, 1e-7, 1e-3]).map(lambda a: np.pi / 2 + a),
)
azimuths = st.one_of(st.floats(0, 2 * np.pi), st.sampled_from([0.0, np.pi / 2, np.pi]))


@st.composite
def frames(draw):
    """n, l, v in a random frame, with every kind of coincidence: equal, opposite, grazing, mirrored."""
    theta, phi = draw(angles), draw(azimuths)
    l = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    theta, phi = draw(angles), draw(azimuths)
    free = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    v = draw(st.sampled_from([free, l, -l, l * [-1, -1, 1], l * [1, 1, -1]]))
    if draw(st.booleans()):
        turn, _ = np.linalg.qr(np.random.default_rng(draw(st.integers(0, 1000))).normal(size=(3, 3)))
        return turn[:, 2], turn @ l, turn @ v
    return np.array([0, 0, 1.0]), l, v


def sound(values, what):
    assert np.isfinite(values).all(), what
    assert (values >= 0).all(), what


@settings(deadline=None, max_examples=200, derandomize=True)
@given(frames(), st.sampled_from([np.float32, np.float64]))
@example((np.array([0, 0, 1.0]),) * 3, np.float64)
@example((np.array([0, 0, 1.0]), np.array([0, 0, 1.0]), np.array([0, 0, -1.0])), np.float64)
@example((np.array([0, 0, 1.0]), np.array([1, 0, 1e-7]), np.array([-1, 0, 1e-7])), np.float32)
@example((np.array([0, 0, 1.0]), np.array([1, 0, 1e-100]), np.array([1, 0, 1e-100])), np.float64)
@example((np.array([0, 0, 1.0]), np.array([1, 0, 1e-300]), np.array([-1, 0, 1e-300])), np.float64)
def test_every_material_is_finite_and_not_negative(frame, dtype):
    n, l, v = (np.asarray(a, dtype).astype(np.float64)[None] for a in frame)
    out = np.empty((1, 3))
    for material, kind, row in zip(EXTREMES, KINDS, ROWS, strict=True):
        reflect_rows(kind, row, n, l, v, np.zeros((1, 3)), out)
        sound(out, material)
        if np.sum(n * l) <= 0:
            assert (out == 0).all(), material


@settings(deadline=None, max_examples=100, derandomize=True)
@given(frames(), st.floats(1e-6, 100), st.floats(1e-6, 100), st.floats(1, 1e6), st.floats(0, 1))
def test_any_slopes_and_indices(frame, m, across, eta, k_s):
    for material in (
        CookTorrance(albedo=0.5, k_s=k_s, m=m, eta=eta),
        EllipticalBeckmann(albedo=0.5, k_s=k_s, m_parallel=m, m_perpendicular=across, eta=eta),
    ):
        sound(reflect(material, *frame), material)


def test_zero_vectors_reflect_nothing():
    up, none = np.array([0, 0, 1.0]), np.zeros(3)
    for material in EXTREMES:
        assert (reflect(material, none, up, up) == 0).all()
        assert (reflect(material, up, none, up) == 0).all()
        sound(reflect(material, up, up, none), material)


def test_directions_broadcast_and_need_not_be_unit():
    material = CookTorrance(albedo=0.3, k_s=0.7, m=0.4)
    n, l = np.array([0, 0, 2.0]), np.random.default_rng(0).normal(size=(5, 1, 3))
    v = np.random.default_rng(1).normal(size=(4, 3))
    out = reflect(material, n, l, v)
    assert out.shape == (5, 4, 3)
    np.testing.assert_allclose(out[2, 3], reflect(material, n / 7, 3 * l[2, 0], v[3]), rtol=1e-12)


@pytest.mark.parametrize(
    "brushed",
    [
        lambda **own: EllipticalBeckmann(albedo=0, m_parallel=0.1, m_perpendicular=0.5, **own),
        lambda **own: PoulinFournier(k_d=0.2, k_s=0.5, spacing=3, **own),
        lambda **own: Ward(k_d=0.2, k_s=0.5, m_parallel=0.1, m_perpendicular=0.5, **own),
        lambda **own: Kajiya(height=90, correlation_parallel=4000, correlation_perpendicular=900, **own),
        lambda **own: AshikhminShirley(albedo=0, exponent_parallel=200, exponent_perpendicular=8, **own),
    ],
)
def test_a_material_s_own_grain_goes_before_the_tangent_of_the_surface(brushed):
    n, l, v = np.array([0, 0, 1.0]), np.array([1, 0, 1.0]), np.array([0.2, 0.3, 1])
    along_x, along_y = (reflect(brushed(grain=g), n, l, v) for g in ((1, 0, 0), (0, 1, 0)))
    assert not np.allclose(along_x, along_y)
    np.testing.assert_array_equal(reflect(brushed(grain=(1, 0, 0)), n, l, v, grain=[0, 1, 0]), along_x)
    np.testing.assert_array_equal(reflect(brushed(grain=(1e-200, 0, 0)), n, l, v, grain=[0, 1, 0]), along_x)
    np.testing.assert_array_equal(reflect(brushed(grain=(1e200, 0, 0)), n, l, v, grain=[0, 1, 0]), along_x)
    np.testing.assert_array_equal(reflect(brushed(), n, l, v, grain=[0, 1, 0.5]), along_y)


@pytest.mark.parametrize("name", ["n", "l", "v", "grain"])
@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([0, np.nan, 1], r"expected finite numbers, got \[ 0. nan  1.\] \(1 such\)"),
        ([[0, 0, 1], [np.inf, 0, 1], [0, np.nan, 0]], r"expected finite numbers, got \[inf  0.  1.\] \(2 such\)"),
        ([0, 0], r"expected an array of shape \(…, 3\), got shape \(2,\)"),
        (np.nan, r"expected an array of shape \(…, 3\), got shape \(\)"),
        ([[0, 0, 1], [1]], r"expected an array of shape \(…, 3\), got rows of different lengths"),
        ("up", "expected real numbers"),
        ([0, 0, 1j], "expected real numbers, got complex128"),
    ],
)
def test_directions_that_are_none_are_refused_by_name(name, value, message):
    given = {"n": [0, 0, 1], "l": [0, 0, 1], "v": [0, 0, 1], "grain": [1, 0, 0]}
    with pytest.raises(OptionError, match=f"^reflect: {name}: {message}"):
        reflect(CookTorrance(albedo=0.3, m=0.4), **given | {name: value})


def test_directions_that_do_not_broadcast_are_refused():
    with pytest.raises(
        OptionError, match=r"n, l, v, grain: expected shapes that broadcast, got n \(2, 3\), l \(5, 3\)"
    ):
        reflect(CookTorrance(albedo=0.3, m=0.4), np.ones((2, 3)), np.ones((5, 3)), [0, 0, 1])
