"""Terms of microfacet models: Fresnel reflectance, facet distributions, geometric attenuation by V-grooves.

Source: Torrance & Sparrow 1967; Beckmann & Spizzichino 1963; Cook & Torrance 1982; (12.34–12.52).
"""

from math import exp, sqrt

from ..kernel.jit import inline
from ..kernel.simd import select


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
    x, y = along / (m_along * nh), across / (m_across * nh)
    exponent = x * x + y * y
    if exponent > 700.0:
        return 0.0  # exp(−700) = 1e-304, while cos⁴θ may underflow
    return exp(-exponent) / (m_along * m_across * nh * nh * nh * nh)
