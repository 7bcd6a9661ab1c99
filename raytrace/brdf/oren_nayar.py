"""Oren–Nayar: V-grooves of Lambertian facets, with one interreflection; clay, plaster, sand, the moon.

f n·l = (ρ/π)(A + ρB), A the first- and B the second-order reflection, fitted by C1, C2, C3.

Row: albedo ρ (RGB), σ in radians.
The fit with its second-order term turns slightly negative near grazing for σ > .6; the result is kept at or above zero.
Source: Oren & Nayar 1994; (12.61–12.64).
"""

from math import atan2, pi, sqrt

import numpy as np
import numpy.typing as npt

from ..kernel.jit import inline
from ..kernel.vector import dot, scale, subtract
from ..types import Float64s
from .layout import MODEL


@inline
def fitted_orders(sigma, n, l, v):
    """(A, B) of f n·l = (ρ/π)(A + ρB): the first- and the second-order reflection."""
    nl, nv = min(1.0, dot(n, l)), min(1.0, max(0.0, dot(n, v)))
    l_flat, v_flat = subtract(l, scale(dot(n, l), n)), subtract(v, scale(dot(n, v), n))
    sin_i, sin_r = sqrt(dot(l_flat, l_flat)), sqrt(dot(v_flat, v_flat))
    cos_delta = 0.0
    if sin_i > 0.0 and sin_r > 0.0:
        cos_delta = max(-1.0, min(1.0, dot(l_flat, v_flat) / (sin_i * sin_r)))
    cos_alpha, cos_beta = min(nl, nv), max(nl, nv)
    sin_alpha, sin_beta = max(sin_i, sin_r), min(sin_i, sin_r)
    alpha, beta = atan2(sin_alpha, cos_alpha), atan2(sin_beta, cos_beta)
    tan_beta = nl * sin_beta / cos_beta  # cosθ_i tanβ, and below cosθ_i tan((α+β)/2): finite at grazing
    tan_mean = nl * (sin_alpha + sin_beta) / (cos_alpha + cos_beta)

    s2 = sigma * sigma
    rough = s2 / (s2 + 0.09)
    ratio = 2.0 * beta / pi
    c1 = 1.0 - 0.5 * s2 / (s2 + 0.33)  # C1, C2, C3: (12.62–12.64)
    c2 = 0.45 * rough * (sin_alpha if cos_delta >= 0.0 else sin_alpha - ratio * ratio * ratio)
    c3 = 4.0 * alpha * beta / (pi * pi)
    c3 = 0.125 * rough * c3 * c3
    first = c1 * nl + c2 * cos_delta * tan_beta + c3 * (1.0 - abs(cos_delta)) * tan_mean  # L1
    second = 0.17 * nl * s2 / (s2 + 0.13) * (1.0 - cos_delta * ratio * ratio)  # L2
    return first, second


@inline
def terms(row, n, l, v):
    first, second = fitted_orders(row[MODEL + 3], n, l, v)
    red, green, blue = row[MODEL], row[MODEL + 1], row[MODEL + 2]
    diffuse = (
        max(0.0, red / pi * (first + red * second)),
        max(0.0, green / pi * (first + green * second)),
        max(0.0, blue / pi * (first + blue * second)),
    )
    return diffuse, (0.0, 0.0, 0.0)


def reference_orders(sigma: float, l: npt.ArrayLike, v: npt.ArrayLike, order: int = 128) -> tuple[float, float]:
    """The integrals that `fitted_orders` fits, for n = (0, 0, 1): slow, and only for measuring the fit.

    A Gaussian distribution of V-groove facets, normalised over projected area as in the paper, each facet Lambertian,
    shadowed and masked by its opposite, and lit once more by it. The second bounce uses Hottel's crossed strings
    between the lit part of one side and the visible part of the other.

    Args: sigma > 0, radians; unit vectors l, v (3,) above the surface; order: quadrature points per half axis.
    Source: Oren & Nayar 1994, sections 4.1–4.3; (12.53–12.60).
    """
    l, v = np.asarray(l, np.float64), np.asarray(v, np.float64)
    end = min(np.pi / 2, 8.0 * sigma)
    nodes, weights = np.polynomial.legendre.leggauss(order)
    theta, d_theta = 0.5 * end * (nodes + 1.0), 0.5 * end * weights
    phi = np.asarray((np.arange(4 * order) + 0.5) * (2.0 * np.pi / (4 * order)), np.float64)
    density = np.exp(-(theta**2) / (2.0 * sigma**2)) * np.sin(theta) * d_theta
    density /= density.sum() * len(phi)

    facet = _directions(theta, phi)
    opposite = _directions(theta, phi + np.pi)
    na = np.cos(theta)[:, None]
    la, va, lo = (np.maximum(0.0, directions @ w) for directions, w in ((facet, l), (facet, v), (opposite, l)))
    lit, seen = _uncovered(na, l[2], la), _uncovered(na, v[2], va)
    projected = va / (na * v[2])
    first = la * projected * np.minimum(lit, seen)  # (12.58) with its GAF

    start_lit, start_seen = 1.0 - _uncovered(na, l[2], lo), 1.0 - seen
    spread = np.cos(2.0 * theta)[:, None]
    strings = _string(1.0, start_seen, spread) + _string(start_lit, 1.0, spread)
    strings = strings - _string(start_lit, start_seen, spread) - _string(1.0, 1.0, spread)
    second = lo * projected * 0.5 * np.maximum(0.0, strings)
    return float(np.sum(density[:, None] * first)), float(np.sum(density[:, None] * second))


def _directions(theta: Float64s, phi: Float64s) -> Float64s:
    """Unit vectors (len(theta), len(phi), 3)."""
    sine = np.sin(theta)[:, None]
    return np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)[:, None]), axis=-1)


def _uncovered(na: Float64s, nw: float, wa: Float64s) -> Float64s:
    """Part of a facet, from its upper edge down, that direction w reaches past the opposite facet."""
    return np.asarray(np.minimum(1.0, np.divide(2.0 * na * nw, wa, out=np.ones_like(wa), where=wa > 0.0)))


def _string(x: Float64s | float, y: Float64s | float, spread: Float64s) -> Float64s:
    """Distance between the points at x on one side of the groove and at y on the other, measured from its bottom."""
    return np.asarray(np.sqrt(np.maximum(0.0, np.square(x) + np.square(y) + 2.0 * x * y * spread)))
