"""Oren–Nayar: V-grooves of Lambertian facets, with one interreflection; clay, plaster, sand, the moon.

f n·l = (ρ/π)(A + ρB), A the first- and B the second-order reflection, fitted by C1, C2, C3.

Row: albedo ρ (RGB), σ in radians.
The fit with its second-order term turns slightly negative near grazing for σ > .6; the result is kept at or above zero.
Source: Oren & Nayar 1994; (12.61–12.64).
"""

from __future__ import annotations

from math import atan2, pi, sqrt
from typing import Literal

from ...kernel.jit import inline
from ...kernel.vector import dot, scale, subtract
from ...system.parameters import Angle
from ..material import MODEL, Diffuse
from ..registry import reflection_model

SIGMA = MODEL + 3


@inline
def fitted_orders(sigma, n, l, v):
    """(A, B) of f n·l = (ρ/π)(A + ρB): the first- and the second-order reflection."""
    # Angles of light and viewer to the normal, and between their azimuths.
    nl = min(1.0, dot(n, l))
    nv = min(1.0, max(0.0, dot(n, v)))
    l_flat = subtract(l, scale(dot(n, l), n))
    v_flat = subtract(v, scale(dot(n, v), n))
    sin_i = sqrt(dot(l_flat, l_flat))
    sin_r = sqrt(dot(v_flat, v_flat))
    cos_delta = 0.0
    if sin_i > 0.0 and sin_r > 0.0:
        cos_delta = max(-1.0, min(1.0, dot(l_flat, v_flat) / (sin_i * sin_r)))
    cos_alpha = min(nl, nv)
    cos_beta = max(nl, nv)
    sin_alpha = max(sin_i, sin_r)
    sin_beta = min(sin_i, sin_r)
    alpha = atan2(sin_alpha, cos_alpha)
    beta = atan2(sin_beta, cos_beta)
    tan_beta = nl * sin_beta / cos_beta  # cosθ_i tanβ, and below cosθ_i tan((α+β)/2): finite at grazing
    tan_mean = nl * (sin_alpha + sin_beta) / (cos_alpha + cos_beta)

    s2 = sigma * sigma
    rough = s2 / (s2 + 0.09)
    ratio = 2.0 * beta / pi
    c1 = 1.0 - 0.5 * s2 / (s2 + 0.33)  # C1, C2, C3: (12.62–12.64)
    c2 = 0.45 * rough * (sin_alpha if cos_delta >= 0.0 else sin_alpha - ratio * ratio * ratio)
    c3 = 4.0 * alpha * beta / (pi * pi)
    c3 = 0.125 * rough * c3 * c3
    first_order = c1 * nl + c2 * cos_delta * tan_beta + c3 * (1.0 - abs(cos_delta)) * tan_mean  # L1
    second = 0.17 * nl * s2 / (s2 + 0.13) * (1.0 - cos_delta * ratio * ratio)  # L2
    return first_order, second


@inline
def terms(row, n, l, v, grain):
    first_order, second = fitted_orders(row[SIGMA], n, l, v)
    red = row[MODEL]
    green = row[MODEL + 1]
    blue = row[MODEL + 2]
    diffuse = (
        max(0.0, red / pi * (first_order + red * second)),
        max(0.0, green / pi * (first_order + green * second)),
        max(0.0, blue / pi * (first_order + blue * second)),
    )
    return diffuse, (0.0, 0.0, 0.0)


@reflection_model(terms)
class OrenNayar(Diffuse):
    """Rough diffuse surface; `sigma` is the standard deviation of facet slope angles, radians in [0, π/2]."""

    model: Literal["oren_nayar"] = "oren_nayar"
    columns = ("albedo", "sigma")
    sigma: Angle
