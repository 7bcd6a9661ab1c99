"""Elliptical Beckmann: Cook–Torrance whose facets have another slope along a grain than across it.

Row: that of `raytrace.brdf.microfacet.Microfacet`, then the slopes m_∥ and m_⊥.
Source: Beckmann & Spizzichino 1963; Cook & Torrance 1982; (12.34–12.52).
"""

from __future__ import annotations

from math import sqrt
from typing import Literal

from ...kernel.jit import inline
from ...kernel.vector import dot, halfway, perpendicular
from ...system.parameters import Slope
from ..material import Brushed, Gloss
from ..microfacet import FACETS, Microfacet, beckmann, coated
from ..registry import reflection_model

M_PARALLEL, M_PERPENDICULAR = FACETS, FACETS + 1


@inline
def terms(row, n, l, v, grain):
    h = halfway(l, v)
    nh = dot(n, h)
    distribution = 0.0
    if nh > 0.0:
        along, across = perpendicular(n, grain)
        distribution = beckmann(dot(h, along), dot(h, across), nh, row[M_PARALLEL], row[M_PERPENDICULAR])
    return coated(row, n, l, v, h, distribution)


@reflection_model(terms)
class EllipticalBeckmann(Brushed, Microfacet):
    """Microfacets of RMS slopes `m_parallel` along the grain and `m_perpendicular` across it, each in [1e-6, 100]."""

    model: Literal["elliptical_beckmann"] = "elliptical_beckmann"
    m_parallel: Slope
    m_perpendicular: Slope

    def lobe_slope(self) -> float:
        return max(self.m_parallel, self.m_perpendicular)

    def gloss(self) -> Gloss:
        return self.mirrored(sqrt(self.m_parallel * self.m_perpendicular))

    def parameters(self) -> list[float]:
        return [*self.interface(), self.m_parallel, self.m_perpendicular]
