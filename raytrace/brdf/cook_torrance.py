"""Cook–Torrance: mirror facets under a Fresnel interface, over a Lambertian base.

f = k_d ρ/π + k_s f_s with k_d = 1 − k_s, and f_s = D G F/(4π (n·l)(n·v)), which conserves energy, or the printed
f_s = D G F/(π (n·l)(n·v)), four times as bright.

Row: ρ (RGB), k_s, η (RGB), shifted (1: the specular colour is used), specular colour (RGB), normalisation 1/(4π) or
1/π; then either m and the Gaussian's c (0: Beckmann), or the two slopes of the elliptical distribution.
Source: Cook & Torrance 1982; (12.34–12.52).
"""

from math import atan2, exp, pi

from ..kernel.jit import inline
from ..kernel.vector import cross, dot, halfway, length, perpendicular, scale, triple
from .layout import MODEL
from .microfacet import beckmann, fresnel, geometric_attenuation

K_S, ETA, SHIFTED, COLOUR, NORMALISATION, M = MODEL + 3, MODEL + 4, MODEL + 7, MODEL + 8, MODEL + 11, MODEL + 12


@inline
def shifted_colour(colour, eta, reflectance):
    """Specular colour per unit light, moving from `colour` at normal incidence to the light's own at grazing."""
    normal = (eta - 1.0) / (eta + 1.0)
    normal *= normal
    if normal >= 1.0:
        return colour
    return colour + (1.0 - colour) * max(0.0, reflectance - normal) / (1.0 - normal)  # colour shift


@inline
def combine(row, nl, nv, h, nh, vh, distribution):
    """k_d f_d and k_s f_s per channel, times n·l."""
    base = (1.0 - row[K_S]) * nl / pi  # k_d f_d, (12.18)
    diffuse = scale(base, triple(row, MODEL))
    if nv <= 0.0 or nh <= 0.0 or vh <= 0.0:
        return diffuse, (0.0, 0.0, 0.0)
    lobe = row[K_S] * row[NORMALISATION] * distribution * geometric_attenuation(nh, nl, nv, vh) / nv  # k_s f_s
    red, green, blue = fresnel(row[ETA], vh), fresnel(row[ETA + 1], vh), fresnel(row[ETA + 2], vh)
    if row[SHIFTED] == 1.0:
        lobe *= (red + green + blue) / 3.0
        red = shifted_colour(row[COLOUR], row[ETA], red)
        green = shifted_colour(row[COLOUR + 1], row[ETA + 1], green)
        blue = shifted_colour(row[COLOUR + 2], row[ETA + 2], blue)
    return diffuse, scale(lobe, (red, green, blue))


@inline
def terms(row, n, l, v):
    h = halfway(l, v)
    nh = dot(n, h)
    sine = length(cross(n, h))  # sinθ_a, exact where 1 − (n·h)² cancels
    distribution = 0.0
    if nh > 0.0:
        if row[M + 1] > 0.0:
            angle = atan2(sine, nh) / row[M]
            distribution = row[M + 1] * exp(-angle * angle)  # c exp(−(θ_a/m)²)
        else:
            distribution = beckmann(sine, 0.0, nh, row[M], row[M])
    return combine(row, dot(n, l), dot(n, v), h, nh, dot(v, h), distribution)


@inline
def terms_elliptical(row, n, l, v, grain):
    h = halfway(l, v)
    nh = dot(n, h)
    distribution = 0.0
    if nh > 0.0:
        g, across = perpendicular(n, grain)
        distribution = beckmann(dot(h, g), dot(h, across), nh, row[M], row[M + 1])
    return combine(row, dot(n, l), dot(n, v), h, nh, dot(v, h), distribution)
