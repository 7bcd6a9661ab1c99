"""Coefficients of the models, computed once when a material is packed."""

from math import acos, asin, pi

import numpy as np

from ..types import Float64s
from .layout import KIRCHHOFF_END, TERMS


def gaussian_constant(m: float) -> float:
    """c with ∫ c exp(−(θ/m)²) cosθ dω = π over the hemisphere, the norm of the Beckmann distribution as printed."""
    end = min(pi / 2, 8.0 * m)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    theta = 0.5 * end * (nodes + 1.0)
    return float(1.0 / (0.5 * end * np.sum(weights * np.exp(-((theta / m) ** 2)) * np.sin(2.0 * theta))))


def cap_angle(spacing: float, floor: float) -> float:
    """Θ, radians: where a cylinder of radius 1 meets the floor, or the next cylinder if that comes first."""
    return acos(floor) if spacing >= 2.0 else min(acos(floor), asin(spacing / 2.0))


def power_series(exponent: float) -> tuple[float, list[float]]:
    """Domain X and odd Chebyshev coefficients, highest first, of ∫_0^x cos^(m+1); beyond X it is constant to 1e-6."""
    domain = min(pi / 2, float(np.arccos(1e-6 ** (1.0 / (exponent + 1.0)))))
    integrand = np.polynomial.Chebyshev.interpolate(
        lambda x: np.cos(x) ** (exponent + 1.0), 2 * (TERMS - 1), domain=[-domain, domain]
    )
    return domain, [float(c) for c in integrand.integ(lbnd=0).coef[:0:-2]]


def kirchhoff_table() -> Float64s:
    """(1 + g)/(1 − e⁻ᵍ) Σ_{j≥1} gʲ e⁻ᵍ/(j! j) e^(−g t/j), where τ = t g/(1 + g): e^(−τ) at g = 0 and for g → ∞.

    Rows (65) are even in g/(1 + g) from 0 to 1, columns (57) in √τ from 0 to `KIRCHHOFF_END`.
    """
    tau = np.linspace(0, KIRCHHOFF_END, 57) ** 2
    table = np.tile(np.exp(-tau), (65, 1))
    for row, y in enumerate(np.linspace(0, 1, len(table))[1:-1], 1):
        g = y / (1 - y)
        j = np.arange(1, int(g + 8 * g**0.5) + 40)[:, None]  # the terms that count where τ ≤ 16
        weights = j * np.log(g) - g - np.cumsum(np.log(j), axis=0) - np.log(j)
        table[row] = np.exp(weights - g * (tau / y) / j).sum(axis=0) * (1 + g) / -np.expm1(-g)
    return table


def eta_from_reflectance(reflectance: float) -> float:
    """Index η of the dielectric that reflects `reflectance` in [0, 1) at normal incidence (Cook & Torrance 1982)."""
    root = reflectance**0.5
    return (1.0 + root) / (1.0 - root)
