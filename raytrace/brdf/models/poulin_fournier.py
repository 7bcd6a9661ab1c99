"""Poulin–Fournier: parallel cylinders of radius 1 on a floor; brushed metal, records, woven and turned surfaces.

Axes lie `spacing` apart at height 0 and run along the grain; the floor lies at height `floor` in [0, 1], so that each
cylinder shows a cap |θ| ≤ Θ. The reflected light is the average, over what the viewer sees of one period, of the
facets' own k_d ⟨n'·l⟩ + k_s ⟨n'·h⟩^m where they are lit. Everything is constant along the grain, so arcs of the
cross-section are intersected, and both integrals over the common arc are closed: the diffuse one exactly, the
specular one through a Chebyshev polynomial of cos^(m+1), as in the paper.

Row: k_d (RGB), k_s (RGB), exponent m, spacing, Θ, sinΘ, cosΘ, Chebyshev domain X, `TERMS` odd coefficients of
∫cos^(m+1), highest order first.
Source: Poulin & Fournier 1990, "A Model for Anisotropic Reflection", added cylinders.
"""

from __future__ import annotations

from math import acos, asin, atan2, copysign, cos, pi, sin, sqrt
from typing import Literal

import numpy as np

from ...kernel.jit import inline
from ...kernel.vector import dot, halfway, perpendicular, scale, triple
from ...system.parameters import Fraction, Spacing
from ..material import MODEL, Brushed, Glossy
from ..registry import reflection_model

TERMS = 16  # Chebyshev coefficients
K_S = MODEL + 3
EXPONENT = MODEL + 6
SPACING = MODEL + 7
CAP = MODEL + 8
DOMAIN = MODEL + 11
SERIES = MODEL + 12


@inline
def visible_part(row, across, up, length):
    """The part of a period that a direction (across, up), up > 0, reaches past the neighbours.

    Returns its angle φ from the normal in the cross-section, cap angles lo, hi, and floor places x0, x1 between this
    axis, 0, and the next, `spacing`.
    """
    spacing = row[SPACING]
    cap = row[CAP]
    sin_cap = row[CAP + 1]
    cos_cap = row[CAP + 2]
    elevation = atan2(up, abs(across))
    lo, hi = max(-cap, -elevation), cap
    x0, x1 = sin_cap, spacing - sin_cap
    if elevation < cap:  # the ray that grazes the neighbour's cap bounds the arc and the floor
        blocked = 0.5 * spacing * up / length
        if blocked < 1.0:
            hi = min(cap, 2.0 * asin(sqrt(blocked)) - elevation)
        x1 = min(x1, spacing + (cos_cap * abs(across) - length) / up)
    if across < 0.0:
        lo, hi, x0, x1 = -hi, -lo, spacing - x1, spacing - x0
    return copysign(0.5 * pi - elevation, across), lo, hi, x0, x1


@inline
def power_integral(row, a, b):
    """∫_a^b cos^(m+1) for |a|, |b| ≤ X: Clenshaw's sums over odd Chebyshev orders, both ends in step."""
    ya = a / row[DOMAIN]
    yb = b / row[DOMAIN]
    za = 4.0 * ya * ya - 2.0
    zb = 4.0 * yb * yb - 2.0
    above_a, here_a, above_b, here_b = 0.0, 0.0, 0.0, 0.0
    for k in range(TERMS):
        c = row[SERIES + k]  # highest order first
        above_a, here_a = here_a, c + za * here_a - above_a
        above_b, here_b = here_b, c + zb * here_b - above_b
    return yb * (here_b - above_b) - ya * (here_a - above_a)


@inline
def cap_highlight(row, h_across, h_up, v_across, v_up, lo, hi):
    """∫ ⟨n'·h⟩^m cos(θ − φ_v) dθ over [lo, hi], for cross-section projections of h and (unit) of v."""
    domain = row[DOMAIN]
    exponent = row[EXPONENT]
    angle = atan2(h_across, h_up)
    a = max(-domain, min(domain, lo - angle))
    b = max(-domain, min(domain, hi - angle))
    if b <= a:
        return 0.0
    length = sqrt(h_across * h_across + h_up * h_up)
    cos_delta = (v_up * h_up + v_across * h_across) / length  # δ = φ_v − φ_h
    sin_delta = (v_across * h_up - v_up * h_across) / length
    even = cos_delta * power_integral(row, a, b)
    start = cos(a) ** (exponent + 1.0) if a > -domain else 0.0
    stop = cos(b) ** (exponent + 1.0) if b < domain else 0.0
    odd = sin_delta * (start - stop) / (exponent + 1.0)
    return max(0.0, even + odd) * min(1.0, length) ** exponent


@inline
def terms(row, n, l, v, grain):
    if dot(n, v) <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    # In the plane across the cylinders: what light and viewer see of one period.
    _, tangent = perpendicular(n, grain)
    h = halfway(l, v)
    l_up = dot(n, l)
    l_across = dot(tangent, l)
    v_up = dot(n, v)
    v_across = dot(tangent, v)
    h_up = dot(n, h)
    l_length = sqrt(l_across * l_across + l_up * l_up)
    v_length = sqrt(v_across * v_across + v_up * v_up)
    light, lit_lo, lit_hi, lit_x0, lit_x1 = visible_part(row, l_across, l_up, l_length)
    view, seen_lo, seen_hi, seen_x0, seen_x1 = visible_part(row, v_across, v_up, v_length)
    diffuse, specular = 0.0, 0.0  # averages over the visible part of a period, each in [0, 1]

    # The arc that both see.
    lo = max(lit_lo, seen_lo)
    hi = min(lit_hi, seen_hi)
    if hi > lo:
        cos_view = v_up / v_length
        sin_view = v_across / v_length
        period = row[SPACING] * cos_view  # as wide as it looks
        width = hi - lo
        product = 0.5 * (
            width * (l_up * cos_view + l_across * sin_view) + l_length * sin(width) * cos(hi + lo - light - view)
        )  # ∫ (n'·l) cos(θ − φ_v) dθ over [lo, hi]
        diffuse = max(0.0, product / period)
        specular = cap_highlight(row, dot(tangent, h), h_up, sin_view, cos_view, lo, hi) / period

    # The floor between the cylinders that both see.
    floor = (min(lit_x1, seen_x1) - max(lit_x0, seen_x0)) / row[SPACING]
    if floor > 0.0:
        diffuse += floor * l_up
        specular += floor * max(0.0, min(1.0, h_up)) ** row[EXPONENT]
    return scale(min(1.0, diffuse), triple(row, MODEL)), scale(min(1.0, specular), triple(row, K_S))


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


@reflection_model(terms)
class PoulinFournier(Brushed, Glossy):
    """Cylinders of radius 1 along the grain: axes `spacing` apart, the floor at height `floor` in [0, 1] above them."""

    model: Literal["poulin_fournier"] = "poulin_fournier"
    spacing: Spacing = 2.0
    floor: Fraction = 0.0

    def parameters(self) -> list[float]:
        domain, series = power_series(self.exponent)
        cap = cap_angle(self.spacing, self.floor)
        return [*self.k_d, *self.k_s, self.exponent, self.spacing, cap, sin(cap), cos(cap), domain, *series]
