"""What microfacet models share: Fresnel reflectance, facet distributions, attenuation by V-grooves, the coated base.

Source: Torrance & Sparrow 1967; Beckmann & Spizzichino 1963; Cook & Torrance 1982; (12.34–12.52).
"""

from __future__ import annotations

from math import exp, pi, sqrt
from typing import Literal

import numpy as np

from ..kernel.jit import inline
from ..kernel.simd import select
from ..kernel.vector import dot, scale, triple
from ..system.parameters import Fraction, Indices, Reflectance
from .layout import MODEL
from .material import Diffuse, Gloss

K_S = MODEL + 3
ETA = MODEL + 4
SHIFTED = MODEL + 7
COLOUR = MODEL + 8
NORMALISATION = MODEL + 11
FACETS = MODEL + 12  # where the distribution's own parameters begin


@inline
def fifth(x):
    square = x * x
    return square * square * x


@inline
def fresnel(eta, cosine):
    """Unpolarised reflectance of a dielectric of relative index η ≥ 1 at c = v·h ≥ 0; 1 at grazing, 0 for η = 1."""
    g = sqrt(max(0.0, eta * eta + cosine * cosine - 1.0))
    a = (g - cosine) / (g + cosine)
    b = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0)
    return select(g + cosine > 0.0, 0.5 * a * a * (1.0 + b * b), 0.0)  # η = 1 at grazing: there is no interface


@inline
def geometric_attenuation(nh, nl, nv, vh):
    """G: the part of a V-groove's facets that is neither shadowed nor masked (Torrance & Sparrow 1967)."""
    return min(min(1.0, 2.0 * nh * nv / vh), 2.0 * nh * nl / vh)


@inline
def beckmann(along, across, nh, m_along, m_across):
    """D of facets with RMS slopes m along and across the grain, as printed: ∫ D cosθ dω = π.

    `along` = h·g, `across` = h·(n×g), `nh` = n·h > 0; tan²θ cos²φ = (along/nh)².
    """
    x = along / (m_along * nh)
    y = across / (m_across * nh)
    exponent = x * x + y * y
    if exponent > 700.0:
        return 0.0  # exp(−700) = 1e-304, while cos⁴θ may underflow
    return exp(-exponent) / (m_along * m_across * nh * nh * nh * nh)


@inline
def shifted_colour(colour, eta, reflectance):
    """Specular colour per unit light, moving from `colour` at normal incidence to the light's own at grazing."""
    normal = (eta - 1.0) / (eta + 1.0)
    normal *= normal
    if normal >= 1.0:
        return colour
    return colour + (1.0 - colour) * max(0.0, reflectance - normal) / (1.0 - normal)  # colour shift


@inline
def coated(row, n, l, v, h, distribution):
    """k_d f_d and k_s f_s per channel, times n·l, of a row of `Microfacet`. Args: distribution: D of h."""
    nl = dot(n, l)
    nv = dot(n, v)
    nh = dot(n, h)
    vh = dot(v, h)
    base = (1.0 - row[K_S]) * nl / pi  # k_d f_d, (12.18)
    diffuse = scale(base, triple(row, MODEL))
    if nv <= 0.0 or nh <= 0.0 or vh <= 0.0:
        return diffuse, (0.0, 0.0, 0.0)
    lobe = row[K_S] * row[NORMALISATION] * distribution * geometric_attenuation(nh, nl, nv, vh) / nv  # k_s f_s
    red = fresnel(row[ETA], vh)
    green = fresnel(row[ETA + 1], vh)
    blue = fresnel(row[ETA + 2], vh)
    if row[SHIFTED] == 1.0:
        lobe *= (red + green + blue) / 3.0
        red = shifted_colour(row[COLOUR], row[ETA], red)
        green = shifted_colour(row[COLOUR + 1], row[ETA + 1], green)
        blue = shifted_colour(row[COLOUR + 2], row[ETA + 2], blue)
    return diffuse, scale(lobe, (red, green, blue))


class Microfacet(Diffuse):
    """k_d = 1 − k_s of a Lambertian body under k_s of mirror facets.

    `eta`: index per channel, ≥ 1. `colour`: specular colour at normal incidence, shifting to the light's at grazing;
    without it each channel has its own Fresnel reflectance. `form`: "conserving", or "book", as the
    textbook prints it, 4 times as bright.

    Row: ρ (RGB), k_s, η (RGB), shifted (1: the specular colour is used), specular colour (RGB), normalisation 1/(4π) or
    1/π; from `FACETS` on, what the distribution takes.
    """

    k_s: Fraction = 1.0
    eta: Indices = (1.5, 1.5, 1.5)
    colour: Reflectance | None = None
    form: Literal["conserving", "book"] = "conserving"

    def mirrored(self, slope: float) -> Gloss:
        """The gloss of facets of this RMS slope."""
        colour = self.colour or (1.0, 1.0, 1.0)
        normal = np.square((np.array(self.eta) - 1) / (np.array(self.eta) + 1))
        mirrored = self.k_s * np.multiply(colour, normal if self.colour is None else normal.mean())
        return Gloss(tuple(mirrored), (self.k_s,) * 3, slope)

    def interface(self) -> list[float]:
        """The columns up to `FACETS`."""
        colour = self.colour or (0.0, 0.0, 0.0)
        normalisation = 1 / (4 * pi) if self.form == "conserving" else 1 / pi
        return [*self.albedo, self.k_s, *self.eta, float(self.colour is not None), *colour, normalisation]
