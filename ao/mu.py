"""μ with its lengths known, of meshes and of kernels: what `ao.falloff` resolves to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from raytrace.kernel.jit import inline
from raytrace.types import Float64s

Form = Literal["binary", "exponential", "linear", "smooth", "table"]
_NO_KNOTS = np.empty(0)


class KernelMu(NamedTuple):
    """A falloff as kernels take it, in render space.

    Attributes:
        tau: rate τ of the exponential form per unit of length, 0 for other forms.
        limit: max_distance D, from which on μ is 1, or inf.
        scale: 1/(1 − e^(−τD)), 1 for other forms.
        distances, values: float64 (k,), μ at ascending distances, linear between them; (0,) for the binary and the
            exponential form.
    """

    tau: float
    limit: float
    scale: float
    distances: Float64s = _NO_KNOTS
    values: Float64s = _NO_KNOTS


@inline
def fades(falloff):
    """Whether a `KernelMu` depends on the distance of what is hit: not if it is binary."""
    return falloff.tau > 0.0 or len(falloff.values) > 0


@inline
def faded(distance, falloff):
    """μ at a distance below the limit of a `KernelMu` that fades (12.74)."""
    if falloff.tau > 0.0:
        return -np.expm1(-falloff.tau * distance) * falloff.scale
    first, last = 0, len(falloff.distances) - 1
    while last - first > 1:
        middle = (first + last) >> 1
        if falloff.distances[middle] <= distance:
            first = middle
        else:
            last = middle
    start, low = falloff.distances[first], falloff.values[first]
    slope = (falloff.values[last] - low) / (falloff.distances[last] - start)
    return min(low + slope * (distance - start), 1.0)


@dataclass(frozen=True)
class Mu:
    """A falloff whose lengths are known: what a bake computes with.

    Attributes:
        form: its name.
        max_distance: from which on μ is 1; mesh units, or inf.
        tau: rate of the exponential form per mesh unit, None for other forms.
        knots: distance and μ of other forms, linear between them; none for binary and exponential.
    """

    form: Form
    max_distance: float
    tau: float | None = None
    knots: tuple[tuple[float, float], ...] = ()

    @property
    def binary(self) -> bool:
        """Whether all that counts is if something is hit."""
        return self.form == "binary"

    def __call__(self, distance: npt.ArrayLike) -> Float64s:
        """μ in [0, 1] of distances (…) in mesh units."""
        x = np.asarray(distance, np.float64)
        if self.tau is not None:
            return np.expm1(-self.tau * np.minimum(x, self.max_distance)) / np.expm1(-self.tau * self.max_distance)
        if self.binary:
            return np.where(x < self.max_distance, 0.0, 1.0)
        return np.asarray(np.interp(x, *np.transpose(self.knots)))

    def in_render_space(self, scale: float) -> KernelMu:
        """The same for lengths that are multiplied by `scale`."""
        tau, limit = (self.tau or 0.0) / scale, self.max_distance * scale
        if not self.knots:
            return KernelMu(tau, limit, -1.0 / math.expm1(-tau * limit) if tau > 0 else 1.0)
        distances, values = np.array(self.knots).T.copy()
        return KernelMu(0.0, limit, 1.0, distances * scale, values)
