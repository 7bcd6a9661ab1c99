"""Phong: diffuse light, and a highlight of the light's colour about the mirror direction r.

k_d ⟨n·l⟩ + k_s W S per unit of light, S = ⟨r·v⟩^m.

Row: k_d (RGB), k_s (RGB), exponent m, six coefficients of the highlight weight.
Source: Phong 1975 (12.22–12.23), whose W(i) W is; the lecture notes on reflection.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Any, Literal

import numpy as np

from ...kernel.jit import inline
from ...kernel.vector import dot, mirror, scale, triple
from ..material import MODEL, Gloss, Glossy
from ..registry import in_lanes, reflection_model

K_D = MODEL
K_S = MODEL + 3
EXPONENT = MODEL + 6
WEIGHT = MODEL + 7
COEFFICIENTS = 6
_WEIGHTS = {"one": (1.0,), "cosine": (0.0, 1.0)}


@inline
def combine(row, cosine, cosine_of_highlight):
    """k_d cosθ and k_s W(θ) S per channel (12.28), for cosθ = n·l > 0; S = ⟨cosine of the highlight⟩^m."""
    highlight = max(0.0, min(1.0, cosine_of_highlight)) ** row[EXPONENT]
    weight = 0.0 * cosine
    for power in range(COEFFICIENTS - 1, -1, -1):
        weight = weight * cosine + row[WEIGHT + power]
    return scale(cosine, triple(row, K_D)), scale(weight * highlight, triple(row, K_S))


@inline
def terms(row, n, l, v, grain):
    return combine(row, dot(n, l), dot(mirror(n, l), v))  # (12.22)


def _weight(value: Any) -> Any:
    """A name, or coefficients whose polynomial is in [0, 1] at 1,001 cosines."""
    if isinstance(value, str) and value in _WEIGHTS:
        return value
    coefficients = np.array(value) if isinstance(value, list | tuple | np.ndarray) else np.array("")
    numeric = coefficients.dtype.kind in "iuf" and coefficients.ndim == 1 and 1 <= len(coefficients) <= COEFFICIENTS
    weights = np.polyval(coefficients[::-1], np.linspace(0, 1, 1001)) if numeric else np.array([np.nan])
    if not -1e-9 <= weights.min() <= weights.max() <= 1 + 1e-9:
        raise ValueError('"one", "cosine" or up to six coefficients of powers of cosθ that sum to 0 to 1 at any angle')
    return tuple(coefficients.tolist())


Weight = Annotated[Literal["one", "cosine"] | tuple[float, ...], _weight]


class PhongFamily(Glossy):
    """k_d ⟨n·l⟩ + k_s W S; `weight` W = 1 ("one"), cosθ ("cosine") or coefficients c_i of Σ c_i cosⁱθ in [0, 1]."""

    weight: Weight = "one"

    def parameters(self) -> list[float]:
        coefficients = np.zeros(COEFFICIENTS)
        weights = _WEIGHTS[self.weight] if isinstance(self.weight, str) else self.weight
        coefficients[: len(weights)] = weights
        return [*self.k_d, *self.k_s, self.exponent, *coefficients]


@reflection_model(terms, in_lanes(terms))
class Phong(PhongFamily):
    """S = ⟨r·v⟩^exponent (12.22–12.23)."""

    model: Literal["phong"] = "phong"

    def gloss(self) -> Gloss:
        mirrored = tuple(k_s * min(1.0, 2 / (self.exponent + 1)) for k_s in self.k_s)  # ∫ S dω/π
        return Gloss(mirrored, mirrored, sqrt(2 / (4 * self.exponent + 2)))
