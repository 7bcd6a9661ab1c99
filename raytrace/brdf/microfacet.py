"""Parts of microfacet models: Fresnel reflectance, facet distributions, attenuation by V-grooves, the coated base.

Source: Torrance & Sparrow 1967; Beckmann & Spizzichino 1963; Cook & Torrance 1982; Born & Wolf 1999; (12.34–12.52).
"""

from __future__ import annotations

from math import exp, pi, sqrt
from typing import Literal

import numpy as np

from ..errors import OptionError
from ..kernel.jit import inline
from ..kernel.simd import select
from ..kernel.vector import dot, scale, triple
from ..system.parameters import ConductorIndices, Extinctions, Fraction, Reflectance
from .material import MODEL, Diffuse, Gloss

K_S = MODEL + 3
ETA = MODEL + 4
SHIFTED = MODEL + 7
COLOUR = MODEL + 8
NORMALISATION = MODEL + 11
K = MODEL + 12
FACETS = MODEL + 15  # where the distribution's own parameters begin
_TRANSPARENT = 1e-6  # the extinction up to which a medium is taken for a dielectric


@inline
def fifth(x):
    """x⁵, as of Schlick's Fresnel term."""
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
def conductor_fresnel(eta, k, cosine):
    """Unpolarised reflectance of a conductor of relative index η − ik, k > 0, at c = v·h ≥ 0 (Born & Wolf 1999, 14.4).

    With a − ib = √((η − ik)² − s²), s² = 1 − c²:
    r_s = ((a − c)² + b²)/((a + c)² + b²), r_p = r_s ((ac − s²)² + b²c²)/((ac + s²)² + b²c²), and F = (r_s + r_p)/2.
    """
    sine2 = max(0.0, 1.0 - cosine * cosine)
    real = eta * eta - k * k - sine2  # of (η − ik)² − s²
    imaginary = 2.0 * eta * k
    larger = sqrt(0.5 * (sqrt(real * real + imaginary * imaginary) + abs(real)))  # of a and b
    smaller = 0.5 * imaginary / larger  # exact where a difference would cancel
    a = select(real > 0.0, larger, smaller)
    b = select(real > 0.0, smaller, larger)
    across = ((a - cosine) * (a - cosine) + b * b) / ((a + cosine) * (a + cosine) + b * b)
    less = a * cosine - sine2
    more = a * cosine + sine2
    b *= cosine
    return 0.5 * across * (1.0 + (less * less + b * b) / (more * more + b * b))


@inline
def reflectance(row, channel, cosine):
    """Fresnel reflectance F of one channel at c = v·h ≥ 0. Args: row: of a `Microfacet`."""
    eta = row[ETA + channel]
    k = row[K + channel]
    return conductor_fresnel(eta, k, cosine) if k > _TRANSPARENT else fresnel(eta, cosine)


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
def shifted_colour(row, channel, arriving):
    """Specular colour per unit light, from the row's at normal incidence to the light's own where `arriving` F is 1."""
    colour = row[COLOUR + channel]
    normal = reflectance(row, channel, 1.0)
    if normal >= 1.0:
        return colour
    return colour + (1.0 - colour) * max(0.0, arriving - normal) / (1.0 - normal)  # colour shift


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
    red = reflectance(row, 0, vh)
    green = reflectance(row, 1, vh)
    blue = reflectance(row, 2, vh)
    if row[SHIFTED] == 1.0:
        lobe *= (red + green + blue) / 3.0
        red = shifted_colour(row, 0, red)
        green = shifted_colour(row, 1, green)
        blue = shifted_colour(row, 2, blue)
    return diffuse, scale(lobe, (red, green, blue))


class Microfacet(Diffuse):
    """k_d = 1 − k_s of a Lambertian body under k_s of mirror facets.

    `eta`: relative index of refraction per channel, ≥ 1 where the extinction coefficient `k` is 0. `colour`: specular
    colour at normal incidence, shifting to the light's at grazing; without it each channel has its own Fresnel
    reflectance. `form`: "conserving", or "book", as the textbook prints it, 4 times as bright.

    Row: ρ (RGB), k_s, η (RGB), shifted (1: the specular colour is used), specular colour (RGB), normalisation 1/(4π) or
    1/π, k (RGB); from `FACETS` on, what the distribution takes.
    """

    k_s: Fraction = 1.0
    eta: ConductorIndices = (1.5, 1.5, 1.5)
    k: Extinctions = (0.0, 0.0, 0.0)
    colour: Reflectance | None = None
    form: Literal["conserving", "book"] = "conserving"

    def check(self) -> None:
        """Check that η ≥ 1 wherever the material is a dielectric. Raises: OptionError."""
        for channel, (index, extinction) in enumerate(zip(self.eta, self.k, strict=True)):
            if index < 1 and extinction <= _TRANSPARENT:
                raise OptionError(f"eta[{channel}]", "a number in [1, 1e6] where k is 0", index, type(self).__name__)

    def mirrored(self, slope: float) -> Gloss:
        """What facets of this RMS slope mirror."""
        colour = self.colour or (1.0, 1.0, 1.0)
        k2 = np.square(self.k)
        normal = (np.square(np.array(self.eta) - 1) + k2) / (np.square(np.array(self.eta) + 1) + k2)
        mirrored = self.k_s * np.multiply(colour, normal if self.colour is None else normal.mean())
        return Gloss(tuple(mirrored), (self.k_s,) * 3, slope)

    def interface(self) -> list[float]:
        """The columns of k_d, k_s, η, k and colour, up to `FACETS`."""
        colour = self.colour or (0.0, 0.0, 0.0)
        normalisation = 1 / (4 * pi) if self.form == "conserving" else 1 / pi
        return [*self.albedo, self.k_s, *self.eta, float(self.colour is not None), *colour, normalisation, *self.k]
