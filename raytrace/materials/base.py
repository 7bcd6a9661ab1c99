"""Base classes of materials: emission, ambient reflectance, packing into a row for kernels."""

from __future__ import annotations

from abc import abstractmethod
from math import pi
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import model_validator

from ..brdf import layout as rows
from ..errors import OptionError
from ..system.parameters import Direction, Exponent, Fraction, Indices, Parameters, Radiance, Reflectance, Sides
from ..types import Float64s

RGB = tuple[float, ...]  # of three
BLACK: RGB = (0.0, 0.0, 0.0)


class Gloss(NamedTuple):
    """Specular reflectance of a material: RGB at normal incidence and at grazing, RMS slope of the facets."""

    normal: RGB
    grazing: RGB
    slope: float


class PackedMaterial(NamedTuple):
    """A material as kernels take it: integer kind, and a float64 row of `rows.WIDTH`."""

    kind: int
    row: Float64s


class BaseMaterial(Parameters):
    """Parameters of every material: emission I_e, and the sides of a surface that reflect.

    `two_sided`: False: the one that the normal points away from. True: the normal turns to the light, n·l → |n·l|, so
    light on either side is seen from both, as through paper. "viewer": it turns to the viewer, so each side reflects
    what falls on it, as an opaque sheet does.
    """

    kind: ClassVar[int]
    columns: ClassVar[tuple[str, ...]]  # the fields of `_parameters`, where these are no more
    physical: ClassVar[bool] = False
    """Whether `reflect` is BRDF·(n·l), in 1/sr, rather than an empirical model's own k_d⟨n·l⟩ + k_s S."""
    emission: Radiance = (0.0, 0.0, 0.0)
    two_sided: Sides = False

    def pack(self) -> PackedMaterial:
        """The kind and parameter row that `raytrace.brdf.dispatch.evaluate` takes."""
        ambient, gloss = getattr(self, "k_a", None), self._gloss()
        side = rows.TO_VIEWER if self.two_sided == "viewer" else rows.TO_LIGHT * self.two_sided
        grain = np.array(getattr(self, "grain", None) or BLACK)
        grain /= np.abs(grain).max() or 1.0  # squares neither overflow nor vanish
        head = [*self.emission, *(self._ambient() if ambient is None else ambient)]
        head += [1.0 - getattr(self, "transparency", 0.0), side, *(grain / (np.linalg.norm(grain) or 1.0))]
        row = [*head, *gloss.normal, *gloss.grazing, gloss.slope, *self._parameters()]  # in the order of `rows`
        return PackedMaterial(self.kind, np.array(row + [0.0] * (rows.WIDTH - len(row))))

    @abstractmethod
    def _ambient(self) -> RGB:
        """k_a unless it is given."""

    def lobe_slope(self) -> float | None:
        """The larger RMS slope of facets that make a highlight about the halfway vector; None for other models."""
        return None

    def _gloss(self) -> Gloss:
        """The part of `k_a` that comes from the mirror direction, as much as the model's highlight reflects."""
        return Gloss(BLACK, BLACK, 1.0)

    def _parameters(self) -> list[float]:
        """The columns from `rows.MODEL` on, in the order the model's file states."""
        return [*np.hstack([getattr(self, name) for name in self.columns])]


class Brushed(BaseMaterial):
    """A material that reflects differently along and across a grain.

    `grain`: world vector, projected into the tangent plane; left out, the surface's tangent (where u grows) is used.
    """

    grain: Direction | None = None


class Diffuse(BaseMaterial):
    """A material with a Lambert-like body of albedo ρ; `k_a`, the ambient reflectance, is ρ unless given."""

    physical: ClassVar[bool] = True
    albedo: Reflectance
    k_a: Reflectance | None = None

    def _ambient(self) -> RGB:
        return self.albedo


class Microfacet(Diffuse):
    """k_d = 1 − k_s of a Lambertian body under k_s of mirror facets.

    `eta`: index per channel, ≥ 1. `colour`: specular colour at normal incidence, shifting to the light's at grazing;
    without it each channel has its own Fresnel reflectance. `form`: "conserving", or "book", as the
    textbook prints it, 4 times as bright.
    """

    k_s: Fraction = 1.0
    eta: Indices = (1.5, 1.5, 1.5)
    colour: Reflectance | None = None
    form: Literal["conserving", "book"] = "conserving"

    def _mirrored(self, slope: float) -> Gloss:
        colour = self.colour or (1.0, 1.0, 1.0)
        normal = np.square((np.array(self.eta) - 1) / (np.array(self.eta) + 1))
        mirrored = self.k_s * np.multiply(colour, normal if self.colour is None else normal.mean())
        return Gloss(tuple(mirrored), (self.k_s,) * 3, slope)

    def _common(self) -> list[float]:
        colour = self.colour or (0.0, 0.0, 0.0)
        normalisation = 1 / (4 * pi) if self.form == "conserving" else 1 / pi
        return [*self.albedo, self.k_s, *self.eta, float(self.colour is not None), *colour, normalisation]


class TwoTerm(BaseMaterial):
    """Diffuse k_d and specular k_s, k_d + k_s ≤ 1 in each channel; `k_a` is k_d unless given."""

    k_d: Reflectance
    k_s: Reflectance = (0.0, 0.0, 0.0)
    k_a: Reflectance | None = None

    @model_validator(mode="after")
    def _absorbs(self) -> TwoTerm:
        for channel, (diffuse, specular) in enumerate(zip(self.k_d, self.k_s, strict=True)):
            if diffuse + specular > 1 + 1e-9:
                got = f"{diffuse} + {specular} = {diffuse + specular:g}"
                raise OptionError(f"k_d + k_s [{channel}]", "at most 1", got, type(self).__name__)
        return self

    def _ambient(self) -> RGB:
        return self.k_d


class Glossy(TwoTerm):
    """Of a highlight of an `exponent` > 0."""

    exponent: Exponent = 20.0
