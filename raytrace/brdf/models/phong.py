"""Phong: diffuse light, and a highlight of the light's colour about the mirror direction r.

k_d ⟨n·l⟩ + k_s W S per unit of light, S = ⟨r·v⟩^m.

Row: k_d (RGB), k_s (RGB), exponent m, highlight weight (0: W = 1, 1: W = cosθ).
Source: Phong 1975 (12.22–12.23); W(θ) from the lecture notes on reflection.
"""

from __future__ import annotations

from math import sqrt
from typing import Literal

from ...kernel.jit import inline
from ...kernel.vector import dot, mirror, scale, triple
from ..layout import MODEL
from ..material import Gloss, Glossy
from ..registry import in_lanes, reflection_model

K_D = MODEL
K_S = MODEL + 3
EXPONENT = MODEL + 6
WEIGHT = MODEL + 7


@inline
def combine(row, cosine, cosine_of_highlight):
    """k_d cosθ and k_s W(θ) S per channel (12.28), for cosθ = n·l > 0; S = ⟨cosine of the highlight⟩^m."""
    highlight = max(0.0, min(1.0, cosine_of_highlight)) ** row[EXPONENT]
    weighted = highlight * cosine if row[WEIGHT] == 1.0 else highlight
    return scale(cosine, triple(row, K_D)), scale(weighted, triple(row, K_S))


@inline
def terms(row, n, l, v, grain):
    return combine(row, dot(n, l), dot(mirror(n, l), v))  # (12.22)


class PhongFamily(Glossy):
    """k_d ⟨n·l⟩ + k_s W S; `weight` W = 1 ("one") or cosθ ("cosine")."""

    weight: Literal["one", "cosine"] = "one"

    def parameters(self) -> list[float]:
        return [*self.k_d, *self.k_s, self.exponent, float(self.weight == "cosine")]


@reflection_model(terms, in_lanes(terms))
class Phong(PhongFamily):
    """S = ⟨r·v⟩^exponent (12.22–12.23)."""

    model: Literal["phong"] = "phong"

    def gloss(self) -> Gloss:
        mirrored = tuple(k_s * min(1.0, 2 / (self.exponent + 1)) for k_s in self.k_s)  # ∫ S dω/π
        return Gloss(mirrored, mirrored, sqrt(2 / (4 * self.exponent + 2)))
