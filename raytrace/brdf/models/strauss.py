"""Strauss: an empirical model with parameters an artist can turn: colour, smoothness, metalness, transparency.

n·l (1 − m s) r_d c + ⟨r·v⟩^(3/(1 − s)) r_j c_s per unit of light, with r_d = (1 − s³)(1 − t).

Row: colour c (RGB), smoothness s, metalness m, transparency t.
F takes the angle of incidence, as in the paper; the printed shader takes the mean of both angles.
Source: Strauss 1990; (12.65–12.70).
"""

from __future__ import annotations

from math import acos, pi, sqrt
from typing import Literal

from ...kernel.jit import inline
from ...kernel.vector import dot, mirror, scale, triple
from ...system.parameters import Fraction, Reflectance, Smoothness
from ..material import MODEL, RGB, Gloss, Material
from ..registry import reflection_model

SMOOTHNESS = MODEL + 3
METALNESS = MODEL + 4
TRANSPARENCY = MODEL + 5
K_F, K_G, K_J = 1.12, 1.01, 0.1


@inline
def fresnel_like(x):
    """F(x), x = 2θ/π in [0, 1]: 0 at normal incidence, 1 at grazing."""
    low = 1.0 / (K_F * K_F)
    high = 1.0 / ((1.0 - K_F) * (1.0 - K_F))
    return (1.0 / ((x - K_F) * (x - K_F)) - low) / (high - low)  # F, Strauss 1990


@inline
def shadowing(x):
    """G(x), x = 2θ/π in [0, 1]: 1 at normal incidence, 0 at grazing."""
    low = 1.0 / (K_G * K_G)
    high = 1.0 / ((1.0 - K_G) * (1.0 - K_G))
    return (high - 1.0 / ((x - K_G) * (x - K_G))) / (high - low)  # G, Strauss 1990


@inline
def normalised_angle(cosine):
    """2θ/π, kept within [0, 1]."""
    return 2.0 / pi * acos(max(0.0, min(1.0, cosine)))


@inline
def terms(row, n, l, v, grain):
    smoothness = row[SMOOTHNESS]
    metalness = row[METALNESS]
    transparency = row[TRANSPARENCY]
    nl = dot(n, l)
    r_d = (1.0 - smoothness * smoothness * smoothness) * (1.0 - transparency)
    r_n = max(0.0, 1.0 - transparency - r_d)
    diffuse = nl * (1.0 - metalness * smoothness) * r_d
    x_i = normalised_angle(nl)
    x_r = normalised_angle(dot(n, v))
    f = fresnel_like(x_i)
    r_j = min(1.0, r_n + (r_n + K_J) * f * shadowing(x_i) * shadowing(x_r))  # adjusted by F and G
    specular = max(0.0, min(1.0, dot(mirror(n, l), v))) ** (3.0 / (1.0 - smoothness)) * r_j
    red, green, blue = triple(row, MODEL)
    tint = metalness * (1.0 - f)  # a metal's highlight takes its colour, save at grazing
    c_s = 1.0 + tint * (red - 1.0), 1.0 + tint * (green - 1.0), 1.0 + tint * (blue - 1.0)
    return scale(diffuse, (red, green, blue)), scale(specular, c_s)


@reflection_model(terms)
class Strauss(Material):
    """Colour, `smoothness` in [0, 1), `metalness` and `transparency` in [0, 1] (12.65–12.70).

    Its ambient reflectance is Q_a = (1 − s³)(1 − t) c and its alpha 1 − t.
    """

    model: Literal["strauss"] = "strauss"
    columns = ("colour", "smoothness", "metalness", "transparency")
    colour: Reflectance
    smoothness: Smoothness
    metalness: Fraction = 0.0
    transparency: Fraction = 0.0

    def ambient(self) -> RGB:
        return tuple((1 - self.smoothness**3) * (1 - self.transparency) * channel for channel in self.colour)

    def gloss(self) -> Gloss:
        exponent = 3 / (1 - self.smoothness)
        part = (1 - self.transparency) * self.smoothness**3 * 2 / (exponent + 1)  # r_n, and ∫ ⟨r·v⟩^h dω/π
        normal = tuple(part * (1 + self.metalness * (channel - 1)) for channel in self.colour)  # c_s
        return Gloss(normal, (part,) * 3, sqrt(2 / (4 * exponent + 2)))
