"""Ashikhmin–Shirley: an anisotropic Phong lobe with Schlick's Fresnel factor, over a body that it leaves light for.

f = f_d + f_s with c = cos²φ, s = sin²φ of h about the grain and F = R_s + (1 − R_s)(1 − l·h)⁵,

- f_s = √((n_∥ + 1)(n_⊥ + 1))/(8π) (n·h)^(n_∥ c + n_⊥ s) F/((l·h) max(n·l, n·v)),
- f_d = 28 ρ/(23π) (1 − R_s) (1 − (1 − n·l/2)⁵)(1 − (1 − n·v/2)⁵).

Row: ρ (RGB), R_s (RGB), n_∥, n_⊥.
Source: Ashikhmin & Shirley 2000, eqs. 4 and 5; Schlick 1994.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Literal

from ...kernel.jit import inline
from ...kernel.simd import select
from ...kernel.vector import dot, halfway, multiply, perpendicular, scale, subtract, triple
from ...system.parameters import Exponent, Reflectance
from ..material import MODEL, RGB, Brushed, Diffuse, Gloss
from ..microfacet import fifth
from ..registry import in_lanes, reflection_model

R_S = MODEL + 3
N_PARALLEL = MODEL + 6
N_PERPENDICULAR = MODEL + 7


@inline
def schlick(reflectance, cosine):
    """F of reflectance R_s at normal incidence: R_s + (1 − R_s)(1 − c)⁵ (Schlick 1994)."""
    return reflectance + (1.0 - reflectance) * fifth(1.0 - cosine)


@inline
def terms(row, n, l, v, grain):
    h = halfway(l, v)
    along, across = perpendicular(n, grain)
    nl = dot(n, l)
    nv = dot(n, v)
    nh = dot(n, h)
    lh = min(1.0, dot(l, h))
    x = dot(h, along)
    y = dot(h, across)
    aside = x * x + y * y  # sin²θ_h
    exponent = (row[N_PARALLEL] * (x * x) + row[N_PERPENDICULAR] * (y * y)) / select(aside > 0.0, aside, 1.0)
    norm = sqrt((row[N_PARALLEL] + 1.0) * (row[N_PERPENDICULAR] + 1.0)) / (8.0 * pi)
    value = norm * max(0.0, min(1.0, nh)) ** exponent * (nl / max(nl, nv)) / lh  # eq. 4
    lobe = select((nv > 0.0) & (nh > 0.0) & (lh > 0.0), value, 0.0)
    facing = fifth(1.0 - 0.5 * max(0.0, nv))
    body = 28.0 / (23.0 * pi) * nl * (1.0 - fifth(1.0 - 0.5 * nl)) * (1.0 - facing)  # eq. 5
    rho = triple(row, MODEL)
    r_s = triple(row, R_S)
    fresnel = schlick(r_s[0], lh), schlick(r_s[1], lh), schlick(r_s[2], lh)
    return scale(body, multiply(subtract((1.0, 1.0, 1.0), r_s), rho)), scale(lobe, fresnel)


@reflection_model(terms, in_lanes(terms))
class AshikhminShirley(Brushed, Diffuse):
    """A Phong lobe of exponents `exponent_parallel` along the grain and `exponent_perpendicular` across it.

    `reflectance`: R_s of the lobe at normal incidence; at grazing it is 1. `albedo`: of the body below, which gets what
    the lobe leaves. `k_a` is R_s + (1 − R_s) ρ unless given.
    """

    model: Literal["ashikhmin_shirley"] = "ashikhmin_shirley"
    columns = ("albedo", "reflectance", "exponent_parallel", "exponent_perpendicular")
    reflectance: Reflectance = (0.04, 0.04, 0.04)
    exponent_parallel: Exponent
    exponent_perpendicular: Exponent

    def ambient(self) -> RGB:
        return tuple(s + (1 - s) * d for d, s in zip(self.albedo, self.reflectance, strict=True))

    def lobe_slope(self) -> float:
        return sqrt(2 / (min(self.exponent_parallel, self.exponent_perpendicular) + 2))  # Walter et al. 2007

    def gloss(self) -> Gloss:
        between = sqrt(self.exponent_parallel * self.exponent_perpendicular)
        return Gloss(self.reflectance, (1.0, 1.0, 1.0), sqrt(2 / (between + 2)))
