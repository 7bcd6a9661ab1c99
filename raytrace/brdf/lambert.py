"""Lambert: the ideal diffuse reflector, equally bright from everywhere: f = ρ/π.

Row: albedo ρ (RGB).
Source: Lambert 1760; (12.18).
"""

from math import pi

from ..kernel.jit import inline
from ..kernel.vector import add, divide, dot, scale, triple
from .layout import MODEL


@inline
def terms(row, n, l):
    none = add(scale(0.0, n), (0.0, 0.0, 0.0))
    return scale(dot(n, l), divide(triple(row, MODEL), pi)), none  # (12.18)
