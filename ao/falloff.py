"""μ, the falloff of obscurance with the distance to what stands in the way (12.72–12.74).

μ(0) = 0, μ(∞) = 1: near geometry closes, far geometry leaves open. Lengths are in the mesh's own units, or relative:
"25%" is a quarter of the mesh's bounding-sphere radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import Field, PlainValidator, ValidationInfo

from raytrace.errors import OptionError
from raytrace.kernel.jit import inline
from raytrace.system.parameters import Parameters
from raytrace.types import Float64s

Length = float | str
DEFAULT_HALF_DISTANCE = "50%"


def resolve_length(field: str, length: Length, radius: float) -> float:
    """`length` in mesh units: a number as it is, "P%" as that part of `radius`.

    Raises:
        OptionError: not a number or percentage above zero ("inf" is allowed).
    """
    expected = 'a length above 0, such as 0.5, "25%" or inf'
    try:
        if isinstance(length, str) and length.strip().endswith("%"):
            value = float(length.strip()[:-1]) / 100 * radius
        else:
            value = float(length)
    except (TypeError, ValueError, OverflowError):
        raise OptionError(field, expected, repr(length)) from None
    if not value > 0:
        raise OptionError(field, expected, repr(length))
    return value


def _length(value: Length, field: ValidationInfo) -> Length:
    resolve_length(str(field.field_name), value, 1.0)
    return value


Rate = Annotated[float, Field(strict=True, gt=0, lt=math.inf, description="a finite rate above 0")]
Limit = Annotated[Length, PlainValidator(_length)]


class KernelMu(NamedTuple):
    """A falloff as kernels take it, in render space.

    Attributes:
        tau: rate τ of the exponential form per unit of length, 0 for the binary form.
        limit: max_distance D, from which on μ is 1, or inf.
        scale: 1/(1 − e^(−τD)), 1 for the binary form.
    """

    tau: float
    limit: float
    scale: float


@inline
def exponential_mu(distance, falloff):
    """μ at a distance below the limit of a `KernelMu`, for τ > 0 (12.74)."""
    return -np.expm1(-falloff.tau * distance) * falloff.scale


@dataclass(frozen=True)
class Mu:
    """A falloff whose lengths are known: what a bake computes with.

    Attributes:
        tau: rate of the exponential form per mesh unit, or None for the binary form.
        max_distance: mesh units, or inf.
    """

    tau: float | None
    max_distance: float

    def __call__(self, distance: npt.ArrayLike) -> Float64s:
        """μ in [0, 1] of distances (…) in mesh units."""
        x = np.asarray(distance, np.float64)
        if self.tau is None:
            return np.where(x < self.max_distance, 0.0, 1.0)
        return np.expm1(-self.tau * np.minimum(x, self.max_distance)) / np.expm1(-self.tau * self.max_distance)

    def in_render_space(self, scale: float) -> KernelMu:
        """The same for lengths that are multiplied by `scale`."""
        tau, limit = (self.tau or 0.0) / scale, self.max_distance * scale
        return KernelMu(tau, limit, -1.0 / math.expm1(-tau * limit) if tau > 0 else 1.0)


class Binary(Parameters, kw_only=False, source="options"):
    """μ = 0 for a hit nearer than `max_distance`, else 1: cosine-weighted ambient visibility.

    Args:
        max_distance: where occlusion ends; a length in mesh units, "P%" of the bounding-sphere radius, or inf.

    Raises:
        OptionError: `max_distance` is not a length above 0.
    """

    max_distance: Limit = math.inf

    def resolve(self, radius: float) -> Mu:
        """μ for a mesh of bounding-sphere radius `radius`."""
        return Mu(None, resolve_length("max_distance", self.max_distance, radius or 1.0))


class Exponential(Parameters, kw_only=False, source="options"):
    """μ(x) = (1 − e^(−τx)) / (1 − e^(−τD)) for x < D, 1 beyond (12.74, with the limit D = `max_distance`).

    Args:
        tau: rate τ per mesh unit, above 0.
        half_distance: ln 2/τ, the distance at which a surface closes half (for D = inf): a length in mesh units or
            "P%" of the bounding-sphere radius. Give this or `tau`; with neither it is `DEFAULT_HALF_DISTANCE`.
        max_distance: D, a length in mesh units, "P%", or inf.

    Raises:
        OptionError: both rates given, or a value out of range.
    """

    tau: Rate | None = None
    half_distance: Limit | None = None
    max_distance: Limit = math.inf

    def __post_init__(self) -> None:
        if self.tau is not None and self.half_distance is not None:
            raise OptionError("tau", "either tau or half_distance", "both")
        if self.half_distance is not None and math.isinf(resolve_length("half_distance", self.half_distance, 1.0)):
            raise OptionError("half_distance", "a finite length", repr(self.half_distance))

    def resolve(self, radius: float) -> Mu:
        """μ for a mesh of bounding-sphere radius `radius`."""
        tau = self.tau
        if tau is None:
            length = DEFAULT_HALF_DISTANCE if self.half_distance is None else self.half_distance
            tau = math.log(2) / resolve_length("half_distance", length, radius or 1.0)
        return Mu(tau, resolve_length("max_distance", self.max_distance, radius or 1.0))


Falloff = Binary | Exponential
