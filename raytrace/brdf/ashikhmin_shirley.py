"""Ashikhmin–Shirley: an anisotropic Phong lobe with Schlick's Fresnel factor, over a body that it leaves light for.

f = f_d + f_s with c = cos²φ, s = sin²φ of h about the grain and F = R_s + (1 − R_s)(1 − l·h)⁵,

- f_s = √((n_∥ + 1)(n_⊥ + 1))/(8π) (n·h)^(n_∥ c + n_⊥ s) F/((l·h) max(n·l, n·v)),
- f_d = 28 ρ/(23π) (1 − R_s) (1 − (1 − n·l/2)⁵)(1 − (1 − n·v/2)⁵).

Row: ρ (RGB), R_s (RGB), n_∥, n_⊥.
Source: Ashikhmin & Shirley 2000, eqs. 4 and 5; Schlick 1994.
"""

from math import pi, sqrt

from ..kernel.jit import inline
from ..kernel.simd import select
from ..kernel.vector import dot, halfway, multiply, perpendicular, scale, subtract, triple
from .layout import MODEL

R_S, N_PARALLEL, N_PERPENDICULAR = MODEL + 3, MODEL + 6, MODEL + 7


@inline
def fifth(x):
    square = x * x
    return square * square * x


@inline
def schlick(reflectance, cosine):
    """F of reflectance R_s at normal incidence: R_s + (1 − R_s)(1 − c)⁵ (Schlick 1994)."""
    return reflectance + (1.0 - reflectance) * fifth(1.0 - cosine)


@inline
def terms(row, n, l, v, grain):
    h = halfway(l, v)
    along, across = perpendicular(n, grain)
    nl, nv, nh, lh = dot(n, l), dot(n, v), dot(n, h), min(1.0, dot(l, h))
    x, y = dot(h, along), dot(h, across)
    x, y = x * x, y * y
    aside = x + y
    exponent = (row[N_PARALLEL] * x + row[N_PERPENDICULAR] * y) / select(aside > 0.0, aside, 1.0)
    norm = sqrt((row[N_PARALLEL] + 1.0) * (row[N_PERPENDICULAR] + 1.0)) / (8.0 * pi)
    value = norm * max(0.0, min(1.0, nh)) ** exponent * (nl / max(nl, nv)) / lh  # eq. 4
    lobe = select((nv > 0.0) & (nh > 0.0) & (lh > 0.0), value, 0.0)
    facing = fifth(1.0 - 0.5 * max(0.0, nv))
    body = 28.0 / (23.0 * pi) * nl * (1.0 - fifth(1.0 - 0.5 * nl)) * (1.0 - facing)  # eq. 5
    rho, r_s = triple(row, MODEL), triple(row, R_S)
    fresnel = schlick(r_s[0], lh), schlick(r_s[1], lh), schlick(r_s[2], lh)
    return scale(body, multiply(subtract((1.0, 1.0, 1.0), r_s), rho)), scale(lobe, fresnel)
