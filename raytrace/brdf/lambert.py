"""Lambert: the ideal diffuse reflector, equally bright from everywhere: f = ρ/π.

Row: albedo ρ (RGB).
Source: Lambert 1760; (12.18).
"""

from math import pi

from ..kernel.jit import inline
from ..kernel.vector import dot
from .layout import MODEL


@inline
def lambert(albedo, n, l):
    """f n·l = (ρ/π)(n·l), one channel, n·l > 0."""
    return albedo / pi * dot(n, l)  # (12.18)


@inline
def terms(row, n, l):
    """Diffuse and specular RGB reflected per unit incident RGB for a packed row."""
    diffuse = (lambert(row[MODEL], n, l), lambert(row[MODEL + 1], n, l), lambert(row[MODEL + 2], n, l))
    return diffuse, (0.0, 0.0, 0.0)
