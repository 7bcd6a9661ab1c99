"""Lambert: the ideal diffuse reflector, equally bright from everywhere: f = ρ/π.

Row: albedo ρ (RGB).
Source: Lambert 1760; (12.18).
"""

from __future__ import annotations

from math import pi
from typing import Literal

from ...kernel.jit import inline
from ...kernel.vector import add, divide, dot, scale, triple
from ..material import MODEL, Diffuse
from ..registry import in_lanes, reflection_model


@inline
def terms(row, n, l, v, grain):
    none = add(scale(0.0, n), (0.0, 0.0, 0.0))
    return scale(dot(n, l), divide(triple(row, MODEL), pi)), none  # (12.18)


@reflection_model(terms, in_lanes(terms))
class Lambert(Diffuse):
    """f = ρ/π (12.18)."""

    model: Literal["lambert"] = "lambert"
    columns = ("albedo",)
