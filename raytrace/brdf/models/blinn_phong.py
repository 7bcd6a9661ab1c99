"""Blinn–Phong: diffuse light, and a highlight of the light's colour about the halfway vector h.

k_d ⟨n·l⟩ + k_s W S per unit of light, S = ⟨n·h⟩^m.

Row: as Phong's.
Source: Blinn 1977 (12.24–12.25).
"""

from __future__ import annotations

from math import sqrt
from typing import Literal

from ...kernel.jit import inline
from ...kernel.vector import dot, halfway
from ..material import Gloss
from ..registry import in_lanes, reflection_model
from .phong import PhongFamily, combine


@inline
def terms(row, n, l, v, grain):
    return combine(row, dot(n, l), dot(n, halfway(l, v)))  # (12.25)


@reflection_model(terms, in_lanes(terms))
class BlinnPhong(PhongFamily):
    """S = ⟨n·h⟩^exponent (12.25)."""

    model: Literal["blinn_phong"] = "blinn_phong"

    def gloss(self) -> Gloss:
        mirrored = tuple(k_s * min(1.0, 8 / (self.exponent + 2)) for k_s in self.k_s)  # ∫ S dω/π, nearly
        return Gloss(mirrored, mirrored, sqrt(2 / (self.exponent + 2)))
