"""Ward and Ashikhmin–Shirley: the white furnace, and Monte Carlo by the papers' own densities against the kernels."""

import numpy as np
import pytest
from scipy.stats import chi2

from obscurance.raytrace import AshikhminShirley, Ward
from obscurance.raytrace.brdf.reflect import NORMAL, albedo, directional_albedo, reflect, towards

ANGLES = np.radians([0, 50, 75, 85, 89.9])
ALONG_X = (1, 0, 0)


def ward(along, across, form):
    return Ward(k_d=0, k_s=1, m_parallel=along, m_perpendicular=across, form=form, grain=ALONG_X)


@pytest.mark.parametrize(("along", "across"), [(0.05, 0.05), (0.1, 0.4), (0.3, 0.3), (1, 1), (3, 0.5)])
def test_the_bounded_ward_form_never_reflects_more_than_arrives(along, across):
    values = [directional_albedo(ward(along, across, "bounded"), a, max(along, across))[0] for a in ANGLES]
    assert max(values) <= 1
    assert values[0] > 0.98 or max(along, across) > 0.1


@pytest.mark.parametrize("exponents", [(1, 1), (10, 1000), (1000, 1000)])
@pytest.mark.parametrize("reflectance", [0, 0.04, 1])
def test_ashikhmin_shirley_never_reflects_more_than_arrives(exponents, reflectance):
    along, across = exponents
    shared = {"reflectance": reflectance, "exponent_parallel": along, "exponent_perpendicular": across}
    material = AshikhminShirley(albedo=1, grain=ALONG_X, **shared)
    values = [albedo(material, a, 64)[0] for a in ANGLES]
    assert max(values) <= 1
    assert max(values) > (0.8 if max(exponents) > 1 else 0.2)


def ward_halfway(along, across, u):
    """Ward 1992, eqs. 6 and 7: halfway vectors of density e⁻ᵉ/(π m_∥ m_⊥ (n·h)³)."""
    phi = np.arctan2(across * np.sin(2 * np.pi * u[1]), along * np.cos(2 * np.pi * u[1]))
    spread = (np.cos(phi) / along) ** 2 + (np.sin(phi) / across) ** 2
    return towards(np.arctan(np.sqrt(-np.log(u[0]) / spread)), phi)


def ashikhmin_shirley_halfway(along, across, u):
    """Ashikhmin & Shirley 2000, eqs. 9 and 10: of density √((n_∥ + 1)(n_⊥ + 1))/(2π) (n·h)^(n_∥ c + n_⊥ s)."""
    turn = 2 * np.pi * u[1]
    phi = np.arctan2(np.sqrt(along + 1) * np.sin(turn), np.sqrt(across + 1) * np.cos(turn))
    power = along * np.cos(phi) ** 2 + across * np.sin(phi) ** 2
    return towards(np.arccos(u[0] ** (1 / (power + 1))), phi)


def density(material, l, v):
    """Of the viewers that the papers' sampling makes, 1/sr, from what the kernel reflects."""
    h = (l + v) / np.linalg.norm(l + v, axis=-1)[..., None]
    nl, nv, nh, lh = l[2], v[..., 2], h[..., 2], h @ l
    f = reflect(material, NORMAL, l, v)[..., 0] / nl
    if isinstance(material, AshikhminShirley):
        return f * np.maximum(nl, nv)
    weights = {"bounded": lh * nh, "ward": np.sqrt(nl * nv) / (lh * nh**3), "duer": nl * nv / (lh * nh**3)}
    return f * weights[material.form]


SAMPLED = [
    *((ward(0.3, 0.6, form), ward_halfway, (0.3, 0.6)) for form in ("bounded", "ward", "duer")),
    (
        AshikhminShirley(
            albedo=0, reflectance=1, exponent_parallel=20, exponent_perpendicular=4, grain=ALONG_X
        ),
        ashikhmin_shirley_halfway, (20, 4),
    ),
]  # fmt: skip


def chi_square(material, sample, shape, incidence):
    """The p-value of sampled viewers in 12×24 cells of equal solid angle, and one cell below the horizon."""
    count, rows, columns, fine = 200_000, 12, 24, 10
    l = towards(incidence, 0.7)
    h = sample(*shape, 1 - np.random.default_rng(5).random((2, count)))
    v = 2 * (h @ l)[:, None] * h - l
    above = v[:, 2] > 0
    cell = np.minimum((v[:, 2] * rows).astype(int), rows - 1) * columns
    cell += (np.arctan2(v[:, 1], v[:, 0]) / (2 * np.pi) % 1 * columns).astype(int) % columns
    seen = np.bincount(cell[above], minlength=rows * columns)

    z = (np.arange(rows * fine) + 0.5) / (rows * fine)
    phi = (np.arange(columns * fine) + 0.5) / (columns * fine) * 2 * np.pi
    grid = towards(np.arccos(z)[:, None], phi)
    values = density(material, l, grid) * 2 * np.pi / (rows * columns * fine**2)
    expected = count * values.reshape(rows, fine, columns, fine).sum(axis=(1, 3)).ravel()
    seen, expected = np.append(seen, count - above.sum()), np.append(expected, count - expected.sum())
    rare = expected < 10
    seen = np.append(seen[~rare], seen[rare].sum())
    expected = np.append(expected[~rare], expected[rare].sum())
    assert expected.min() > 0
    return chi2.sf(np.sum((seen - expected) ** 2 / expected), len(seen) - 1)


@pytest.mark.parametrize("incidence", [0.3, 1.0])
@pytest.mark.parametrize(("material", "sample", "shape"), SAMPLED)
def test_sampled_viewers_are_distributed_as_the_kernel_reflects(material, sample, shape, incidence):
    assert chi_square(material, sample, shape, incidence) > 0.001
