"""Kajiya: the Kirchhoff integral of a surface of Gaussian heights, correlated farther along a grain than across it.

For RMS height σ, correlation lengths T_∥ and T_⊥, wavelength λ = 2π/k and s = l + v, per channel,

    g = k²σ²(n·s)²,  m_i = 2σ/T_i,  t = tan²θ_h (cos²φ_h/m_∥² + sin²φ_h/m_⊥²),
    f = F G/(4 (n·l)(n·v)) · 1/(π m_∥ m_⊥ (n·h)⁴) · c S(g, t),  S = g Σ_{j≥1} gʲ e⁻ᵍ/(j! j) e^(−g t/j).

F and G are Fresnel's and the V-grooves' of Cook & Torrance. S → e⁻ᵗ for g → ∞, so that the elliptical Beckmann model is
the limit of short waves. The other part of the integral is a mirror's, F e^(−g), which no point light can show.
c = 1 is the integral's; c = (1 − e^(−4k²σ² min(n·l, n·v)²))/(1 − e⁻ᵍ) scatters no more than the mirror part leaves.
S is looked up (`kirchhoff_table`), to 1e-4 of its largest value for a g.

Row: η (RGB), kσ (RGB), m_∥, m_⊥, conserving (1: c as above).
Source: Kajiya 1985 has the integral, the grain and its mapping; Beckmann & Spizzichino 1963 and He et al. 1991 have the
series for one correlation length. Two lengths in it, and c, are ours.
"""

from __future__ import annotations

from math import exp, inf, pi, sqrt
from typing import ClassVar, Literal

import numpy as np

from ...errors import OptionError
from ...kernel.jit import inline
from ...kernel.simd import WIDE, pick, replace, select
from ...kernel.vector import dot, halfway, perpendicular, scale
from ...system.parameters import Indices, Nanometres, Reflectance, Wavelengths
from ...types import Float64s
from ..material import MODEL, RGB, Brushed, Gloss
from ..microfacet import fresnel, geometric_attenuation
from ..registry import reflection_model

TABLE_END = 4.0  # √τ in the last column of the table
FARTHEST = 1e30  # of t: nothing is scattered so far
NEARLY_NONE = 0.05  # below, the series of 1 − e⁻ˣ is exact to 5e-8


def kirchhoff_table() -> Float64s:
    """(1 + g)/(1 − e⁻ᵍ) Σ_{j≥1} gʲ e⁻ᵍ/(j! j) e^(−g t/j), where τ = t g/(1 + g): e^(−τ) at g = 0 and for g → ∞.

    Rows (65) are even in g/(1 + g) from 0 to 1, columns (57) in √τ from 0 to `TABLE_END`.
    """
    tau = np.linspace(0, TABLE_END, 57) ** 2
    table = np.tile(np.exp(-tau), (65, 1))
    for row, y in enumerate(np.linspace(0, 1, len(table))[1:-1], 1):
        g = y / (1 - y)
        j = np.arange(1, int(g + 8 * g**0.5) + 40)[:, None]  # the terms that count where τ ≤ 16
        weights = j * np.log(g) - g - np.cumsum(np.log(j), axis=0) - np.log(j)
        table[row] = np.exp(weights - g * (tau / y) / j).sum(axis=0) * (1 + g) / -np.expm1(-g)
    return table


_table = kirchhoff_table()
LAST_G = _table.shape[0] - 1
LAST_T = _table.shape[1] - 1
TABLE = _table.ravel()
ONE, TWO, THREE, NEXT = np.array([1, 2, 3, LAST_T + 1], np.uint64)  # unsigned: no test for negative indices
SIXTH = 1.0 / 6.0
ETA = MODEL
WAVE = MODEL + 3
M_PARALLEL = MODEL + 6
M_PERPENDICULAR = MODEL + 7
CONSERVING = MODEL + 8


@inline
def cubic_weights(x):
    """Of values at −1, 0, 1 and 2 for the cubic through them at x (Lagrange)."""
    before = x * (x - 1.0)
    after = (x + 1.0) * (x - 2.0)
    return before * (2.0 - x) * SIXTH, 0.5 * after * (x - 1.0), -0.5 * after * x, before * (x + 1.0) * SIXTH


@inline
def weighted(start, a, b, c, d):
    """a, b, c and d times four neighbours in a row of the table, from the entry `start` on, added up."""
    return a * TABLE[start] + b * TABLE[start + ONE] + c * TABLE[start + TWO] + d * TABLE[start + THREE]


@inline
def scattered(g, t):
    """S/(1 − e⁻ᵍ), from the table of S (1 + g)/(g (1 − e⁻ᵍ)) over g/(1 + g) and √τ, τ = t g/(1 + g); then 0."""
    y = g / (1.0 + g)
    tau = t * y
    if tau >= TABLE_END * TABLE_END:
        return 0.0
    row = y * LAST_G
    column = sqrt(tau) * (LAST_T / TABLE_END)
    i = max(1, min(int(row), LAST_G - 2))
    j = max(1, min(int(column), LAST_T - 2))
    a, b, c, d = cubic_weights(row - i)
    p, q, r, s = cubic_weights(column - j)
    start = np.uint64((i - 1) * (LAST_T + 1) + j - 1)
    value = a * weighted(start, p, q, r, s) + b * weighted(start + NEXT, p, q, r, s)
    value += c * weighted(start + TWO * NEXT, p, q, r, s) + d * weighted(start + THREE * NEXT, p, q, r, s)
    return y * max(0.0, value)


@inline
def scattered_channels(row, together, t):
    """`scattered` of R, G and B for n·l + n·v."""
    red = row[WAVE] * together
    green = row[WAVE + 1] * together
    blue = row[WAVE + 2] * together
    return scattered(red * red, t), scattered(green * green, t), scattered(blue * blue, t)


@inline
def incidence(row, n, l, v, grain):
    """n·l, n·v, v·h, t, and G/(4 π m_∥ m_⊥ (n·h)⁴ n·v); t is infinite where nothing is reflected."""
    h = halfway(l, v)
    nl = dot(n, l)
    nv = dot(n, v)
    nh = dot(n, h)
    vh = dot(v, h)
    along, across = perpendicular(n, grain)
    x = dot(h, along) / (row[M_PARALLEL] * nh)
    y = dot(h, across) / (row[M_PERPENDICULAR] * nh)
    t = select((nv > 0.0) & (nh > 0.0) & (vh > 0.0), x * x + y * y, inf)
    square = nh * nh
    shape = geometric_attenuation(nh, nl, nv, vh) / (row[M_PARALLEL] * row[M_PERPENDICULAR] * square * square)
    return nl, nv, vh, t, shape / (4.0 * pi * nv)


@inline
def channel(row, c, at, part):
    """f n·l of channel c, of what is scattered. Args: at: `incidence`; part: `scattered`."""
    nl, nv, vh, _, shape = at
    together = nl + nv
    if row[CONSERVING] == 1.0:
        together = 2.0 * min(nl, nv)
    least = row[WAVE + c] * together
    x = least * least
    series = x * (1.0 - x * (0.5 - x * (SIXTH - x / 24.0)))  # of 1 − e⁻ˣ, in single precision, too
    value = fresnel(row[ETA + c], vh) * shape * part * select(x < NEARLY_NONE, series, 1.0 - exp(-x))
    return select(part > 0.0, value, 0.0)


@inline
def terms(row, n, l, v, grain):
    dark = (0.0, 0.0, 0.0)
    at = incidence(row, n, l, v, grain)
    if not at[3] < FARTHEST:
        return dark, dark
    red, green, blue = scattered_channels(row, at[0] + at[1], at[3])
    if red + green + blue == 0.0:
        return dark, dark
    return dark, (channel(row, 0, at, red), channel(row, 1, at, green), channel(row, 2, at, blue))


@inline
def terms_in_lanes(row, n, l, v, grain, wanted):
    """`terms` in lanes, but for the table, where the mask `wanted` is set."""
    at = incidence(row, n, l, v, grain)
    dark = scale(0.0, n)
    red, green, blue = dark
    reached = wanted & (at[3] < FARTHEST)
    for lane in range(WIDE):
        if pick(reached, lane):
            together = np.float64(pick(at[0], lane)) + np.float64(pick(at[1], lane))
            parts = scattered_channels(row, together, np.float64(pick(at[3], lane)))
            red = replace(red, lane, parts[0])
            green = replace(green, lane, parts[1])
            blue = replace(blue, lane, parts[2])
    return dark, (channel(row, 0, at, red), channel(row, 1, at, green), channel(row, 2, at, blue))


@reflection_model(terms, terms_in_lanes)
class Kajiya(Brushed):
    """A surface of Gaussian heights that scatters each wavelength its own way (Kirchhoff's integral). Lengths: nm.

    `height`: RMS height σ. `correlation_parallel`, `correlation_perpendicular`: correlation lengths T along and across
    the grain, at least the longest of the `wavelengths` (of R, G and B) and 2σ, beyond which Kirchhoff's
    approximation means nothing. `eta`: index per channel, ≥ 1. `form`: "conserving", or "kirchhoff", the integral as it
    is, which with its mirror part exceeds 1 towards grazing. `k_a` is the reflectance at normal incidence unless given.
    """

    model: Literal["kajiya"] = "kajiya"
    physical: ClassVar[bool] = True
    height: Nanometres
    correlation_parallel: Nanometres
    correlation_perpendicular: Nanometres
    wavelengths: Wavelengths = (611.0, 549.0, 464.0)
    eta: Indices = (1.5, 1.5, 1.5)
    form: Literal["conserving", "kirchhoff"] = "conserving"
    k_a: Reflectance | None = None

    def check(self) -> None:
        """Check that correlation lengths are long enough for Kirchhoff's approximation. Raises: OptionError."""
        super().check()
        least = max(*self.wavelengths, 2 * self.height)
        for name in ("correlation_parallel", "correlation_perpendicular"):
            if getattr(self, name) < least:
                expected = f"at least the longest wavelength and twice the height, {least:g} nm"
                raise OptionError(name, expected, getattr(self, name), "Kajiya")

    def slopes(self) -> tuple[float, float]:
        """RMS slopes along and across the grain, 2σ/T."""
        return 2 * self.height / self.correlation_parallel, 2 * self.height / self.correlation_perpendicular

    def lobe_slope(self) -> float:
        """Of what is scattered at 60° by the longest wavelength: diffraction by short correlation lengths widens it."""
        wave = max(self.wavelengths) / pi
        return sqrt(4 * self.height**2 + wave**2) / min(self.correlation_parallel, self.correlation_perpendicular)

    def ambient(self) -> RGB:
        return tuple(((eta - 1) / (eta + 1)) ** 2 for eta in self.eta)

    def gloss(self) -> Gloss:
        """One lobe for the mirror part and what is scattered: of the mean of their squared slopes, for green light."""
        mirrored = exp(-((4 * pi * self.height / self.wavelengths[1]) ** 2))
        along, across = self.slopes()
        return Gloss(self.ambient(), (1.0, 1.0, 1.0), sqrt((1 - mirrored) * along * across))

    def parameters(self) -> list[float]:
        waves = [2 * pi * self.height / wavelength for wavelength in self.wavelengths]
        return [*self.eta, *waves, *self.slopes(), float(self.form == "conserving")]
