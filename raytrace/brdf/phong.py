"""Phong and Blinn–Phong: diffuse light, and a highlight of the light's colour.

k_d ⟨n·l⟩ + k_s W S per unit of light, S = ⟨r·v⟩^m (Phong) or ⟨n·h⟩^m (Blinn).

Row: k_d (RGB), k_s (RGB), exponent m, highlight weight (0: W = 1, 1: W = cosθ).
Source: Phong 1975 (12.22–12.23); Blinn 1977 (12.24–12.25); W(θ) from the lecture notes on reflection.
"""

from ..kernel.jit import inline
from ..kernel.vector import dot, halfway, mirror, scale, triple
from .layout import MODEL


@inline
def combine(row, cosine, cosine_of_highlight):
    """k_d cosθ and k_s W(θ) S per channel (12.28), for cosθ = n·l > 0; S = ⟨cosine of the highlight⟩^m."""
    highlight = max(0.0, min(1.0, cosine_of_highlight)) ** row[MODEL + 6]
    weighted = highlight * cosine if row[MODEL + 7] == 1.0 else highlight
    return scale(cosine, triple(row, MODEL)), scale(weighted, triple(row, MODEL + 3))


@inline
def terms_phong(row, n, l, v):
    return combine(row, dot(n, l), dot(mirror(n, l), v))  # (12.22)


@inline
def terms_blinn(row, n, l, v):
    return combine(row, dot(n, l), dot(n, halfway(l, v)))  # (12.25)
