"""Warnock: as bright as the light's distance makes it, whichever way the surface faces: intensity falls with depth.

ρ per unit of light for n·l > 0, and the light's attenuation a(d) does the rest. With the lamp at the viewer d is depth.

Row: ρ (RGB).
Source: Warnock 1969, as the textbook's history of illumination algorithms has it.
"""

from __future__ import annotations

from typing import Literal

from ...kernel.jit import inline
from ...kernel.vector import add, scale, triple
from ..material import MODEL, Diffuse
from ..registry import in_lanes, reflection_model


@inline
def terms(row, n, l, v, grain):
    none = add(scale(0.0, n), (0.0, 0.0, 0.0))
    return add(none, triple(row, MODEL)), none


@reflection_model(terms, in_lanes(terms))
class Warnock(Diffuse):
    """`albedo` ρ of the light that arrives, at every angle of incidence below 90°."""

    model: Literal["warnock"] = "warnock"
    physical = False
    columns = ("albedo",)
