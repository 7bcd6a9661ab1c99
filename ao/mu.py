"""μ with its lengths known, of meshes and of kernels: what `ao.falloff` resolves to."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.errors import OptionError, numbers
from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.types import Bools, Float64s, Int64s

_NO_KNOTS = np.empty(0)
MAX_KNOTS = 1 << 16
STEPS = 1024
ROUNDING = 1e-6  # by which knots may miss a function, and that 0, 1 and monotony
Function = Callable[[float], float]


class KernelColumns(NamedTuple):
    """k falloffs, of which kernels make an estimate each from the same rays; see `KernelMu`."""

    taus: Float64s
    limits: Float64s
    scales: Float64s
    squares: Bools  # whether e^(−τd) is the square of the next column's, so that no exponential is needed
    starts: Int64s  # (k + 1,), where the knots of each begin
    distances: Float64s
    values: Float64s


class KernelMu(NamedTuple):
    """A falloff as kernels take it, in render space."""

    tau: float  # rate τ of the exponential form per unit of length, 0 for other forms
    limit: float  # max_distance D, from which on μ is 1, or inf
    scale: float  # 1/(1 − e^(−τD)), 1 for other forms
    distances: Float64s = _NO_KNOTS  # (k,), ascending, none for the binary and the exponential form
    values: Float64s = _NO_KNOTS  # μ there, linear between them
    columns: KernelColumns | None = None  # several falloffs instead of this one, whose limit is the largest of theirs

    @property
    def shape(self) -> tuple[int, ...]:
        """(k,) of k columns, else ()."""
        return self.columns.taus.shape if self.columns else ()


@inline
def depends_on_distance(falloff: KernelMu) -> bool:
    """Whether a `KernelMu` depends on the distance of what is hit: not if it is binary."""
    return falloff.tau > 0.0 or len(falloff.values) > 0 or falloff.columns is not None


@inline
def attenuation(distance, falloff):
    """μ at a distance below the limit of a `KernelMu` that depends on distance (12.74)."""
    if falloff.tau > 0.0:
        return -np.expm1(-falloff.tau * distance) * falloff.scale
    return _between_knots(distance, falloff.distances, falloff.values, 0, len(falloff.distances) - 1)


@inline
def _between_knots(distance, distances, values, low_knot, high_knot):
    """μ at a distance by the knots from `low_knot` to `high_knot`, linear between them."""
    while high_knot - low_knot > 1:
        middle = (low_knot + high_knot) >> 1
        if distances[middle] <= distance:
            low_knot = middle
        else:
            high_knot = middle
    start = distances[low_knot]
    low = values[low_knot]
    slope = (values[high_knot] - low) / (distances[high_knot] - start)
    return min(low + slope * (distance - start), 1.0)


@inline
def accumulate_occlusion(columns, distance, share, occlusion):
    """Add `share` times 1 − μ at a distance, by each of `KernelColumns`, to `occlusion`, float64 (k,)."""
    power = 0.0
    for c in range(len(columns.taus) - 1, -1, -1):
        mu = 0.0
        if columns.taus[c] > 0.0:
            if columns.squares[c]:
                power *= power
                below = power - 1.0
            else:
                below = np.expm1(-columns.taus[c] * distance)
                power = 1.0 + below
            mu = -below * columns.scales[c]
        elif distance < columns.limits[c] and columns.starts[c] < columns.starts[c + 1]:
            first_knot = columns.starts[c]
            last_knot = columns.starts[c + 1] - 1
            mu = _between_knots(distance, columns.distances, columns.values, first_knot, last_knot)
        if distance < columns.limits[c]:
            occlusion[c] += share * (1.0 - mu)


class Mu(NamedTuple):
    """A falloff whose lengths are known, in mesh units: what a bake computes with."""

    form: str  # "binary", "exponential", "table" or the name of a polynomial
    max_distance: float  # from which on μ is 1, or inf
    tau: float | None = None  # rate of the exponential form, None for other forms
    knots: tuple[tuple[float, float], ...] = ()  # distance and μ, linear between them; none for binary and exponential

    @property
    def binary(self) -> bool:
        """Whether a hit closes whatever its distance, below the limit."""
        return self.form == "binary"

    def __call__(self, distance: npt.ArrayLike) -> Float64s:
        """μ in [0, 1] of distances (…) in mesh units."""
        x = np.asarray(distance, np.float64)
        if self.tau is not None:
            nearer = np.expm1(-self.tau * np.minimum(x, self.max_distance))
            return np.asarray(nearer / np.expm1(-self.tau * self.max_distance))
        if self.binary:
            return np.where(x < self.max_distance, 0.0, 1.0)
        return np.asarray(np.interp(x, *np.transpose(self.knots)))

    def in_render_space(self, scale: float) -> KernelMu:
        """The falloff as kernels take it, for lengths multiplied by `scale`."""
        tau = (self.tau or 0.0) / scale
        limit = self.max_distance * scale
        if not self.knots:
            return KernelMu(tau, limit, -1.0 / math.expm1(-tau * limit) if tau > 0 else 1.0)
        distances, values = np.array(self.knots).T.copy()
        return KernelMu(0.0, limit, 1.0, distances * scale, values)


def in_render_space(mus: Sequence[Mu], scale: float) -> KernelMu:
    """One falloff as kernels take it, or columns of several, for lengths multiplied by `scale`."""
    return mus[0].in_render_space(scale) if len(mus) == 1 else columns_in_render_space(mus, scale)


def columns_in_render_space(mus: Sequence[Mu], scale: float) -> KernelMu:
    """Columns of falloffs, or of one, for lengths multiplied by `scale`."""
    placed = [mu.in_render_space(scale) for mu in mus]
    taus, limits, scales = np.array([[mu.tau, mu.limit, mu.scale] for mu in placed]).T.copy()
    squares = np.array([*(tau == 2 * after > 0 for tau, after in pairwise(taus)), False])
    starts = np.cumsum([0, *(len(mu.values) for mu in placed)])
    distances = np.concatenate([mu.distances for mu in placed])
    values = np.concatenate([mu.values for mu in placed])
    columns = KernelColumns(taus, limits, scales, squares, starts, distances, values)
    return KernelMu(0.0, float(limits.max()), 1.0, columns=columns)


def function_knots(function: Function, limit: float | None) -> tuple[Float64s, Float64s]:
    """Distances (k,) from 0 to `limit`, or else to where the function comes within a rounding of 1, and its values.

    The first 1,025 are denser towards 0; then the middle between two joins them while the function is not there what
    linear interpolation says.

    Raises: OptionError: it is no number somewhere, or never reaches 1.
    """
    largest = _reach(function) if limit is None else limit
    distances = largest * np.linspace(0, 1, STEPS + 1) ** 2
    values = _sampled(function, distances)
    while True:
        middles = (distances[1:] + distances[:-1]) / 2
        between = _sampled(function, middles)
        is_bent = ~(np.abs(between - (values[1:] + values[:-1]) / 2) <= ROUNDING)
        is_bent &= (distances[:-1] < middles) & (middles < distances[1:])
        if not is_bent.any() or len(distances) + np.count_nonzero(is_bent) > MAX_KNOTS:
            return distances, values
        after = np.flatnonzero(is_bent) + 1
        distances = np.insert(distances, after, middles[is_bent])
        values = np.insert(values, after, between[is_bent])


def _sampled(function: Function, distances: Float64s) -> Float64s:
    """A function's values at distances. Raises: OptionError: they are no numbers."""
    values = [function(distance) for distance in distances.tolist()]
    return numbers(values, "options", "function", "a number at every distance")


def _reach(function: Function) -> float:
    """The first distance, from 1e-12 to 1e12 in steps of 1 %, at which the function is 1 within a rounding."""
    for distance in 1.01 ** np.arange(-2777.0, 2778.0):
        if _sampled(function, np.array([distance]))[0] >= 1 - ROUNDING:
            return float(distance)
    expected = "values that reach 1, or ao.Tabulated.of(function, max_distance)"
    raise OptionError("function", expected, "values below 1 up to a distance of 1e12")
