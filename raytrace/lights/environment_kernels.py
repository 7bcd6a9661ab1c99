"""Light from all around: what arrives at a surface from a sky or an image, and what a glossy one mirrors of it.

All of it as I_a is: light that is L in every direction is L. `skies` are rows as `raytrace.lights.layout` has them;
`harmonics` and `maps` are of an image, made by `raytrace.lights.environment`.
"""

from math import acos, asin, atan2, cos, erf, exp, floor, log2, pi, sqrt

import numpy as np

from ..kernel.jit import inline
from ..kernel.vector import add, dot, scale, subtract, triple
from .layout import GROUND, HORIZON, MAP_HEIGHT, MAP_SLOPE, MAP_WIDTH, MAPS, UP, ZENITH


@inline
def gradient(sky, above, rise):
    """ground + (horizon − ground)·above + (zenith − horizon)·rise, exactly the colour that all three are."""
    ground, horizon, zenith = triple(sky, GROUND), triple(sky, HORIZON), triple(sky, ZENITH)
    over_ground = add(ground, scale(above, subtract(horizon, ground)))
    return add(over_ground, scale(rise, subtract(zenith, horizon)))


@inline
def sky_irradiance(sky, n):
    """(1/π) ∫ L(d) ⟨n·d⟩ dω of a sky gradient, closed.

    With c = n·up, a hemisphere of light brings (1 + c)/2, and light that grows as ⟨d·up⟩ brings
    (2/3π)(√(1 − c²) + c asin c) + c/3: half of E|d·up||d·n| of a Gaussian vector, and of its odd part.
    """
    c = max(-1.0, min(1.0, dot(n, triple(sky, UP))))
    return gradient(sky, 0.5 * (1.0 + c), 2.0 / (3.0 * pi) * (sqrt(1.0 - c * c) + c * asin(c)) + c / 3.0)


@inline
def sky_radiance(sky, d, slope):
    """L of a sky gradient about a unit direction d, blurred by the reflection of facets of RMS `slope`.

    Directions spread by σ = √2 slope about d. The first two moments of their height over the horizon are those of the
    heat kernel on the sphere, exp(−l(l + 1)σ²/2); they are taken for Gaussian.
    """
    variance = 2.0 * slope * slope
    height = dot(d, triple(sky, UP))
    square = 1.0 / 3.0 + (height * height - 1.0 / 3.0) * exp(-3.0 * variance)
    height *= exp(-variance)
    deviation = sqrt(max(1e-12, square - height * height))
    z = height / deviation
    above = 0.5 * (1.0 + erf(z / sqrt(2.0)))
    return gradient(sky, above, height * above + deviation * exp(-0.5 * z * z) / sqrt(2.0 * pi))


@inline
def harmonic_irradiance(harmonics, n):
    """(1/π) ∫ L(d) ⟨n·d⟩ dω of an image, from its nine coefficients (Ramamoorthi & Hanrahan 2001)."""
    x, y, z = n
    basis = (1.0, y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y)
    total = (0.0, 0.0, 0.0)
    for k in range(9):
        total = add(total, scale(basis[k], triple(harmonics[k], 0)))
    return (max(0.0, total[0]), max(0.0, total[1]), max(0.0, total[2]))


@inline
def map_radiance(maps, frame, d, slope):
    """L of an image about a unit direction d, blurred for facets of RMS `slope`: bilinear, linear between two maps."""
    right, front, up = triple(frame[0], 0), triple(frame[1], 0), triple(frame[2], 0)
    u = 0.5 + atan2(dot(d, right), dot(d, front)) / (2.0 * pi)
    v = acos(max(-1.0, min(1.0, dot(d, up)))) / pi
    level = slope / MAP_SLOPE
    if level > 1.0:  # slopes double from the second map on
        level = min(MAPS - 1.0, 1.0 + log2(level))
    lower = min(int(level), MAPS - 2)
    part = level - lower
    return add(scale(1.0 - part, bilinear_map(maps[lower], u, v)), scale(part, bilinear_map(maps[lower + 1], u, v)))


@inline
def bilinear_map(texels, u, v):
    """Of a map (MAP_HEIGHT, MAP_WIDTH, 3), which goes round along u."""
    x, y = u * MAP_WIDTH - 0.5, max(0.0, min(MAP_HEIGHT - 1.0, v * MAP_HEIGHT - 0.5))
    left, upper = floor(x), min(int(y), MAP_HEIGHT - 2)
    s, t = x - left, y - upper
    right = (left + 1) % MAP_WIDTH
    left = left % MAP_WIDTH
    return add(
        scale(1.0 - t, add(scale(1.0 - s, texel(texels, upper, left)), scale(s, texel(texels, upper, right)))),
        scale(t, add(scale(1.0 - s, texel(texels, upper + 1, left)), scale(s, texel(texels, upper + 1, right)))),
    )


@inline
def texel(texels, row, column):
    """RGB in double precision."""
    return (np.float64(texels[row, column, 0]), np.float64(texels[row, column, 1]), np.float64(texels[row, column, 2]))


@inline
def cone_visibility(w, aside, slope):
    """The part of what is mirrored that is open, where w is, and the mirror direction is `aside` of the bent normal.

    What is open is taken for a cone about the bent normal that w is the cosine-weighted part of, sin²θ = w; what is
    mirrored for one of half-angle √2 slope. 1 where w is 1, 0 where it is 0. After Oat & Sander 2007.
    """
    open_, mirrored = asin(sqrt(max(0.0, min(1.0, w)))), min(0.5 * pi, max(0.05, sqrt(2.0) * slope))
    t = max(0.0, min(1.0, 0.5 + (open_ + w * mirrored - aside) / (2.0 * mirrored)))
    narrow = (1.0 - sqrt(max(0.0, 1.0 - w))) / (1.0 - cos(mirrored))
    return t * t * (3.0 - 2.0 * t) * min(1.0, narrow)
