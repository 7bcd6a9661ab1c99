"""Materials: the parameters of every reflection model, typed and checked.

    clay = OrenNayar(albedo=(0.7, 0.5, 0.4), sigma=0.5)
    clay.to_dict()                    # {"model": "oren_nayar", "albedo": [0.7, 0.5, 0.4], "sigma": 0.5}
    material_from_dict({"preset": "clay", "sigma": 0.2})

Reflectances are RGB in [0, 1] (one number means three equal ones), angles radians. Formulas: `raytrace.brdf`;
the types that signatures name (`Reflectance`, `Slope`, …) and their ranges: `raytrace.system.parameters`.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import model_validator

from ..brdf import layout as rows
from ..brdf.coefficients import gaussian_constant
from ..errors import OptionError
from ..system.parameters import Angle, Fraction, Positive, Reflectance, Slope, Smoothness, made_of
from ..types import Float64s, Int64s
from .anisotropic import AshikhminShirley, EllipticalBeckmann, Kajiya, PoulinFournier, Ward
from .base import RGB, BaseMaterial, Diffuse, Gloss, Glossy, Microfacet
from .presets import preset


class Lambert(Diffuse):
    """f = ρ/π (12.18)."""

    model: Literal["lambert"] = "lambert"
    kind: ClassVar[int] = rows.LAMBERT
    columns = ("albedo",)


class OrenNayar(Diffuse):
    """Rough diffuse surface; `sigma` is the standard deviation of facet slope angles, radians in [0, π/2]."""

    model: Literal["oren_nayar"] = "oren_nayar"
    kind: ClassVar[int] = rows.OREN_NAYAR
    columns = ("albedo", "sigma")
    sigma: Angle


class CookTorrance(Microfacet):
    """Isotropic microfacets of RMS slope `m` in [1e-6, 100] (12.34–12.52).

    `gaussian_c` scales the Gaussian distribution; left out, it is chosen so that the distribution has Beckmann's norm.
    """

    model: Literal["cook_torrance"] = "cook_torrance"
    kind: ClassVar[int] = rows.COOK_TORRANCE
    m: Slope
    distribution: Literal["beckmann", "gaussian"] = "beckmann"
    gaussian_c: Positive | None = None

    def lobe_slope(self) -> float:
        return self.m

    def _gloss(self) -> Gloss:
        return self._mirrored(self.m)

    def _parameters(self) -> list[float]:
        gaussian = gaussian_constant(self.m) if self.gaussian_c is None else self.gaussian_c
        return [*self._common(), self.m, 0.0 if self.distribution == "beckmann" else gaussian]

    @model_validator(mode="after")
    def _c_is_used(self) -> CookTorrance:
        if self.gaussian_c is not None and self.distribution != "gaussian":
            raise OptionError("gaussian_c", 'distribution = "gaussian" with it', self.distribution, "CookTorrance")
        return self


class _PhongFamily(Glossy):
    """k_d ⟨n·l⟩ + k_s W S; `weight` W = 1 ("one") or cosθ ("cosine")."""

    weight: Literal["one", "cosine"] = "one"

    def _parameters(self) -> list[float]:
        return [*self.k_d, *self.k_s, self.exponent, float(self.weight == "cosine")]


class Phong(_PhongFamily):
    """S = ⟨r·v⟩^exponent (12.22–12.23)."""

    model: Literal["phong"] = "phong"
    kind: ClassVar[int] = rows.PHONG

    def _gloss(self) -> Gloss:
        mirrored = tuple(k_s * min(1.0, 2 / (self.exponent + 1)) for k_s in self.k_s)  # ∫ S dω/π
        return Gloss(mirrored, mirrored, sqrt(2 / (4 * self.exponent + 2)))


class BlinnPhong(_PhongFamily):
    """S = ⟨n·h⟩^exponent (12.25)."""

    model: Literal["blinn_phong"] = "blinn_phong"
    kind: ClassVar[int] = rows.BLINN_PHONG

    def _gloss(self) -> Gloss:
        mirrored = tuple(k_s * min(1.0, 8 / (self.exponent + 2)) for k_s in self.k_s)  # ∫ S dω/π, nearly
        return Gloss(mirrored, mirrored, sqrt(2 / (self.exponent + 2)))


class Strauss(BaseMaterial):
    """Colour, `smoothness` in [0, 1), `metalness` and `transparency` in [0, 1] (12.65–12.70).

    Its ambient reflectance is Q_a = (1 − s³)(1 − t) c and its alpha 1 − t.
    """

    model: Literal["strauss"] = "strauss"
    kind: ClassVar[int] = rows.STRAUSS
    columns = ("colour", "smoothness", "metalness", "transparency")
    colour: Reflectance
    smoothness: Smoothness
    metalness: Fraction = 0.0
    transparency: Fraction = 0.0

    def _ambient(self) -> RGB:
        return tuple((1 - self.smoothness**3) * (1 - self.transparency) * channel for channel in self.colour)

    def _gloss(self) -> Gloss:
        exponent = 3 / (1 - self.smoothness)
        part = (1 - self.transparency) * self.smoothness**3 * 2 / (exponent + 1)  # r_n, and ∫ ⟨r·v⟩^h dω/π
        normal = tuple(part * (1 + self.metalness * (channel - 1)) for channel in self.colour)  # c_s
        return Gloss(normal, (part,) * 3, sqrt(2 / (4 * exponent + 2)))


Material = (
    Lambert | Phong | BlinnPhong | CookTorrance | EllipticalBeckmann | OrenNayar | Strauss | PoulinFournier
    | Ward | AshikhminShirley | Kajiya
)  # fmt: skip


def material_from_dict(data: dict[str, Any]) -> BaseMaterial:
    """A material from plain values: `model` and its fields, or `preset` and the fields to change in it.

    Raises: OptionError naming the material, the field, what is accepted and what came.
    """
    if "preset" in data:
        data = preset(data["preset"]) | {name: value for name, value in data.items() if name != "preset"}
    return made_of(data, get_args(Material), "model", "material")


def pack_materials(materials: list[BaseMaterial]) -> tuple[Int64s, Float64s]:
    """Kinds (k,) int64 and rows (k, rows.WIDTH) float64 of a list of materials, for a kernel that meets them all."""
    packed = [material.pack() for material in materials]
    kinds = np.array([p.kind for p in packed], np.int64)
    return kinds, np.array([p.row for p in packed], np.float64).reshape(-1, rows.WIDTH)
