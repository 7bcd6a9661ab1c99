"""Cook–Torrance: mirror facets under a Fresnel interface, over a Lambertian base.

f = k_d ρ/π + k_s f_s with k_d = 1 − k_s, and f_s = D G F/(4π (n·l)(n·v)), which conserves energy, or the printed
f_s = D G F/(π (n·l)(n·v)), four times as bright. D is Beckmann's distribution of the facets, or c exp(−(θ/m)²), θ of h.

Row: that of `raytrace.brdf.microfacet.Microfacet`, then m and the Gaussian's c (0: Beckmann).
Source: Cook & Torrance 1982; (12.34–12.52).
"""

from __future__ import annotations

from functools import lru_cache
from math import atan2, exp, pi
from typing import Literal

import numpy as np

from ...errors import OptionError
from ...kernel.jit import inline
from ...kernel.vector import cross, dot, halfway, length
from ...system.parameters import Positive, Slope
from ..material import Gloss
from ..microfacet import FACETS, Microfacet, beckmann, coated
from ..registry import reflection_model

M, GAUSSIAN_C = FACETS, FACETS + 1


@inline
def terms(row, n, l, v, grain):
    h = halfway(l, v)
    nh = dot(n, h)
    sine = length(cross(n, h))  # sinθ_a, exact where 1 − (n·h)² cancels
    distribution = 0.0
    if nh > 0.0:
        if row[GAUSSIAN_C] > 0.0:
            angle = atan2(sine, nh) / row[M]
            distribution = row[GAUSSIAN_C] * exp(-angle * angle)  # c exp(−(θ_a/m)²)
        else:
            distribution = beckmann(sine, 0.0, nh, row[M], row[M])
    return coated(row, n, l, v, h, distribution)


@lru_cache
def gaussian_constant(m: float) -> float:
    """c with ∫ c exp(−(θ/m)²) cosθ dω = π over the hemisphere, the norm of the Beckmann distribution as printed."""
    end = min(pi / 2, 8.0 * m)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    theta = 0.5 * end * (nodes + 1.0)
    return float(1.0 / (0.5 * end * np.sum(weights * np.exp(-((theta / m) ** 2)) * np.sin(2.0 * theta))))


@reflection_model(terms)
class CookTorrance(Microfacet):
    """Isotropic microfacets of RMS slope `m` in [1e-6, 100] (12.34–12.52).

    `gaussian_c` scales the Gaussian distribution; left out, it is chosen so that the distribution has Beckmann's norm.
    """

    model: Literal["cook_torrance"] = "cook_torrance"
    m: Slope
    distribution: Literal["beckmann", "gaussian"] = "beckmann"
    gaussian_c: Positive | None = None

    def lobe_slope(self) -> float:
        return self.m

    def gloss(self) -> Gloss:
        return self.mirrored(self.m)

    def parameters(self) -> list[float]:
        constant = 0.0
        if self.distribution == "gaussian":
            constant = gaussian_constant(self.m) if self.gaussian_c is None else self.gaussian_c
        return [*self.interface(), self.m, constant]

    def check(self) -> None:
        """Check that `gaussian_c` is given for the Gaussian distribution alone. Raises: OptionError."""
        super().check()
        if self.gaussian_c is not None and self.distribution != "gaussian":
            raise OptionError("gaussian_c", 'distribution = "gaussian" with it', self.distribution, "CookTorrance")
