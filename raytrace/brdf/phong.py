"""Phong and Blinn–Phong: diffuse light, and a highlight of the light's colour.

k_d ⟨n·l⟩ + k_s W S per unit of light, S = ⟨r·v⟩^m (Phong) or ⟨n·h⟩^m (Blinn).

Row: k_d (RGB), k_s (RGB), exponent m, highlight weight (0: W = 1, 1: W = cosθ).
Source: Phong 1975 (12.22–12.23); Blinn 1977 (12.24–12.25); W(θ) from the lecture notes on reflection.
"""

from ..kernel.jit import inline
from ..kernel.vector import dot, halfway, mirror
from .layout import MODEL


@inline
def phong_highlight(n, l, v, exponent):
    """S = ⟨r·v⟩^m."""
    return max(0.0, min(1.0, dot(mirror(n, l), v))) ** exponent  # (12.22)


@inline
def blinn_highlight(n, l, v, exponent):
    """S = ⟨n·h⟩^m."""
    return max(0.0, min(1.0, dot(n, halfway(l, v)))) ** exponent  # (12.25)


@inline
def combine(row, cosine, highlight):
    """k_d cosθ and k_s W(θ) S per channel (12.28), for cosθ = n·l > 0."""
    weighted = highlight * cosine if row[MODEL + 7] == 1.0 else highlight
    diffuse = (row[MODEL] * cosine, row[MODEL + 1] * cosine, row[MODEL + 2] * cosine)
    return diffuse, (row[MODEL + 3] * weighted, row[MODEL + 4] * weighted, row[MODEL + 5] * weighted)


@inline
def terms_phong(row, n, l, v):
    """Diffuse and specular RGB reflected per unit incident RGB for a packed row, r·v form."""
    return combine(row, dot(n, l), phong_highlight(n, l, v, row[MODEL + 6]))


@inline
def terms_blinn(row, n, l, v):
    """Diffuse and specular RGB reflected per unit incident RGB for a packed row, n·h form."""
    return combine(row, dot(n, l), blinn_highlight(n, l, v, row[MODEL + 6]))
