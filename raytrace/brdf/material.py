"""Base classes of materials: emission, ambient reflectance, diffuse bodies; packing into rows for kernels.

A row of float64 begins with the same head for every model, whose columns are named here; the model's own parameters
follow from column `MODEL` on, in the order its file states.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..errors import OptionError
from ..system.parameters import Direction, Exponent, Parameters, Radiance, Reflectance, Sides
from ..types import Float64s, Int64s

EMISSION = 0  # I_e, emitted RGB
AMBIENT = 3  # k_a, RGB reflected of unit ambient light
ALPHA = 6  # opacity of the pixel (Strauss: 1 − t; otherwise 1)
TWO_SIDED = 7  # 0, or the side the normal turns to: TO_LIGHT or TO_VIEWER
GRAIN = 8  # unit direction of the grain, scene axes; zero: the surface's tangent is used
GLOSS, GRAZING = 11, 14  # RGB that is mirrored of what is around, at normal incidence and at grazing
SLOPE = 17  # RMS slope of the facets that mirror it
BRUSHED = 18  # 1: reflects differently along and across a grain
MODEL = 19
TO_LIGHT, TO_VIEWER = 1.0, 2.0

RGB = tuple[float, ...]  # of three
BLACK: RGB = (0.0, 0.0, 0.0)


class Gloss(NamedTuple):
    """Specular reflectance of a material: RGB at normal incidence and at grazing, RMS slope of the facets."""

    normal: RGB
    grazing: RGB
    slope: float


class PackedMaterial(NamedTuple):
    """A material as kernels take it: integer kind, and a float64 row whose columns are named above."""

    kind: int
    row: Float64s


class Material(Parameters):
    """Parameters of every material: emission I_e, and the sides of a surface that reflect.

    `two_sided`: False: the one that the normal points away from. True: the normal turns to the light, so that n·l is
    positive: light on either side is seen from both, as through paper. "viewer": it turns to the viewer, so each
    side reflects what falls on it, as an opaque sheet does.
    """

    kind: ClassVar[int]
    terms: ClassVar[Any]
    terms_in_lanes: ClassVar[Any]
    """These three by `raytrace.brdf.registry.reflection_model`."""
    columns: ClassVar[tuple[str, ...]]  # the fields that `parameters` are, unless a class has its own
    physical: ClassVar[bool] = False
    """Whether `reflect` is BRDF·(n·l), in 1/sr, rather than an empirical model's own k_d⟨n·l⟩ + k_s S."""
    emission: Radiance = (0.0, 0.0, 0.0)
    two_sided: Sides = False

    def pack(self) -> PackedMaterial:
        """The kind and parameter row that `raytrace.brdf.dispatch.evaluate` takes."""
        k_a = getattr(self, "k_a", None)
        gloss = self.gloss()
        grain = np.array(getattr(self, "grain", None) or BLACK)
        grain /= np.abs(grain).max() or 1.0  # squares neither overflow nor vanish
        parameters = self.parameters()

        row = np.zeros(MODEL + len(parameters))
        row[EMISSION : EMISSION + 3] = self.emission
        row[AMBIENT : AMBIENT + 3] = self.ambient() if k_a is None else k_a
        row[ALPHA] = 1.0 - getattr(self, "transparency", 0.0)
        row[TWO_SIDED] = TO_VIEWER if self.two_sided == "viewer" else TO_LIGHT * self.two_sided
        row[GRAIN : GRAIN + 3] = grain / (np.linalg.norm(grain) or 1.0)
        row[GLOSS : GLOSS + 3] = gloss.normal
        row[GRAZING : GRAZING + 3] = gloss.grazing
        row[SLOPE] = gloss.slope
        row[BRUSHED] = isinstance(self, Brushed)
        row[MODEL:] = parameters
        return PackedMaterial(self.kind, row)

    @abstractmethod
    def ambient(self) -> RGB:
        """The default of `k_a`, the ambient reflectance."""

    def lobe_slope(self) -> float | None:
        """The larger RMS slope of facets that make a highlight about the halfway vector; None for other models."""
        return None

    def gloss(self) -> Gloss:
        """The part of `k_a` that comes from the mirror direction, as much as the model's highlight reflects."""
        return Gloss(BLACK, BLACK, 1.0)

    def parameters(self) -> list[float]:
        """The columns from `MODEL` on, in the order the model's file states; first the diffuse colour."""
        return [*np.hstack([getattr(self, name) for name in self.columns])]


class Brushed(Material):
    """A material that reflects differently along and across a grain.

    `grain`: world vector, projected into the tangent plane; left out, the surface's tangent (where u grows) is used.
    """

    grain: Direction | None = None


class Diffuse(Material):
    """A material with a Lambert-like body of albedo ρ; `k_a`, the ambient reflectance, is ρ unless given."""

    physical: ClassVar[bool] = True
    albedo: Reflectance
    k_a: Reflectance | None = None

    def ambient(self) -> RGB:
        return self.albedo


class TwoTerm(Material):
    """Diffuse k_d and specular k_s, k_d + k_s ≤ 1 in each channel; `k_a` is k_d unless given."""

    k_d: Reflectance
    k_s: Reflectance = (0.0, 0.0, 0.0)
    k_a: Reflectance | None = None

    def check(self) -> None:
        """Check that k_d + k_s ≤ 1 in every channel. Raises: OptionError."""
        for channel, (diffuse, specular) in enumerate(zip(self.k_d, self.k_s, strict=True)):
            if diffuse + specular > 1 + 1e-9:
                got = f"{diffuse} + {specular} = {diffuse + specular:g}"
                raise OptionError(f"k_d + k_s [{channel}]", "at most 1", got, type(self).__name__)

    def ambient(self) -> RGB:
        return self.k_d


class Glossy(TwoTerm):
    """A material whose highlight has an `exponent` > 0."""

    exponent: Exponent = 20.0


def pack_materials(materials: Sequence[Material]) -> tuple[Int64s, Float64s]:
    """Kinds (k,) int64 and rows (k, longest) float64 of materials, for a kernel that meets them all."""
    packed = [material.pack() for material in materials]
    material_rows = np.zeros((len(packed), max((len(material.row) for material in packed), default=MODEL)))
    for row, material in zip(material_rows, packed, strict=True):
        row[: len(material.row)] = material.row
    return np.array([material.kind for material in packed], np.int64), material_rows
