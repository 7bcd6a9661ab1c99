"""μ, the falloff of obscurance with the distance to what stands in the way (12.72–12.74).

μ(0) = 0, μ(∞) = 1: near geometry closes, far geometry leaves open. Lengths are in the mesh's own units, or relative:
"25%" is a quarter of the mesh's bounding-sphere radius.
"""

from __future__ import annotations

import math
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any, ClassVar, TypeGuard

import numpy as np

from obscurance.raytrace.errors import ConflictError, OptionError, nearest_name, numbers
from obscurance.raytrace.types import Float64s

from .mu import MAX_KNOTS, ROUNDING, STEPS, Function, Mu, function_knots

Length = float | str
DEFAULT_HALF_DISTANCE = "50%"


def resolve_length(field: str, length: Length, radius: float) -> float:
    """`length` in mesh units: a number as it is, "P%" as that part of `radius`.

    Raises:
        OptionError: not a number or percentage above zero ("inf" is allowed), or below 2.2e-308.
    """
    expected = 'a length above 0, such as 0.5, "25%" or inf'
    text = str(length).strip()
    unit = radius / 100 if text.endswith("%") else 1.0
    try:
        value = float(text.removesuffix("%")) * unit if isinstance(length, str) else float(length)
    except (TypeError, ValueError, OverflowError):
        raise OptionError(field, expected, repr(length)) from None
    if not value >= sys.float_info.min:  # μ divides by lengths
        raise OptionError(field, expected, repr(length))
    return value


def is_length(value: object) -> TypeGuard[Length]:
    """Whether a value is meant as a length, as a number or in words, not as a mesh for instance."""
    return isinstance(value, str | Real)


def _resolve_finite(field: str, length: Length, like: str = ', such as 0.5 or "25%"') -> float:
    """A length in mesh units from one or from "P%" of 100. Args: like: examples, for the message.

    Raises: OptionError: it is not above 0, infinite or no length.
    """
    value = resolve_length(field, length, 100.0)
    if math.isinf(value):
        raise OptionError(field, f"a finite length{like}", repr(length))
    return value


FALLOFFS: dict[str, type[Any]] = {}
"""The classes of `Falloff` that have a name, by it; they take a `max_distance`."""
POLYNOMIALS: dict[str, Mapping[int, float]] = {}
"""Coefficients of μ by powers of x/D, of each `Polynomial` by its name."""


@dataclass(frozen=True)
class Falloff(ABC):
    """Base class of falloffs, which are frozen dataclasses. A subclass with a `name` is known by it in options and
    scene files."""

    if TYPE_CHECKING:  # a field or a property of every subclass

        @property
        def max_distance(self) -> Length:
            """From which on μ is 1: a length in mesh units, "P%" of the bounding-sphere radius, or inf."""

    def __init_subclass__(cls, name: str = "") -> None:
        if name:
            FALLOFFS[name] = cls

    @abstractmethod
    def resolve(self, radius: float) -> Mu:
        """μ for a mesh of bounding-sphere radius `radius`."""


@dataclass(frozen=True)
class Exponential(Falloff, name="exponential"):
    """μ(x) = (1 − e^(−τx)) / (1 − e^(−τD)) for x < D, 1 beyond (12.74, with the limit D = `max_distance`).

    Args:
        tau: rate τ per mesh unit, above 0.
        half_distance: ln 2/τ, the distance at which a surface closes half (for D = inf): a length in mesh units or
            "P%" of the bounding-sphere radius. Give this or `tau`; with neither it is `DEFAULT_HALF_DISTANCE`.
        max_distance: D, a length in mesh units, "P%", or inf.

    Raises:
        OptionError: both rates given, or a value out of range.
    """

    tau: float | None = None
    half_distance: Length | None = None
    max_distance: Length = math.inf

    def __post_init__(self) -> None:
        if self.tau is not None and not (isinstance(self.tau, Real) and 0 < self.tau < math.inf):
            raise OptionError("tau", "a finite rate above 0", self.tau)
        resolve_length("max_distance", self.max_distance, 1.0)
        if self.tau is not None and self.half_distance is not None:
            raise ConflictError("tau", "excludes", "half_distance")
        if self.half_distance is not None:
            _resolve_finite("half_distance", self.half_distance, "")

    def resolve(self, radius: float) -> Mu:
        """μ for a mesh of bounding-sphere radius `radius`."""
        tau = self.tau
        if tau is None:
            length = DEFAULT_HALF_DISTANCE if self.half_distance is None else self.half_distance
            tau = math.log(2) / resolve_length("half_distance", length, radius or 1.0)
        return Mu("exponential", resolve_length("max_distance", self.max_distance, radius or 1.0), tau)


@dataclass(frozen=True)
class Binary(Falloff, name="binary"):
    """μ = 0 for a hit nearer than `max_distance`, else 1: cosine-weighted ambient visibility.

    Args:
        max_distance: where occlusion ends; a length in mesh units, "P%" of the bounding-sphere radius, or inf.

    Raises:
        OptionError: `max_distance` is not a length above 0.
    """

    max_distance: Length = math.inf

    def __post_init__(self) -> None:
        resolve_length("max_distance", self.max_distance, 1.0)

    def resolve(self, radius: float) -> Mu:
        """μ for a mesh of bounding-sphere radius `radius`."""
        return Mu("binary", resolve_length("max_distance", self.max_distance, radius or 1.0))


@dataclass(frozen=True)
class Polynomial(Falloff):
    """Base class of forms that are polynomials in t = x/D for x < D, 1 beyond: linear between 1,025 values.

    A subclass has a `name` and `coefficients`, by powers of t: from 0 at t = 0 to 1 at t = 1, nowhere falling.

    Args: max_distance: D, a finite length in mesh units or "P%" of the bounding-sphere radius.

    Raises: OptionError: `max_distance` is not a finite length above 0.
    """

    coefficients: ClassVar[Mapping[int, float]]
    max_distance: Length

    def __init_subclass__(cls, name: str = "") -> None:
        super().__init_subclass__(name)
        cls.form = name
        POLYNOMIALS[name] = cls.coefficients

    form: ClassVar[str]

    def __post_init__(self) -> None:
        _resolve_finite("max_distance", self.max_distance)

    def resolve(self, radius: float) -> Mu:
        """μ for a mesh of bounding-sphere radius `radius`."""
        limit = resolve_length("max_distance", self.max_distance, radius or 1.0)
        lowest = min(self.coefficients)
        highest = max(self.coefficients)
        t = np.linspace(0, 1, 2 if highest == 1 else STEPS + 1)
        values = np.zeros_like(t)
        for power in range(highest, lowest - 1, -1):  # Horner's scheme
            values = values * t + self.coefficients.get(power, 0.0)
        return Mu(self.form, limit, knots=_knots(limit * t, t**lowest * values))


class Linear(Polynomial, name="linear"):
    """μ(x) = x/D for x < D, 1 beyond: linear attenuation, the limit of the exponential form for τ → 0.

    Args, Raises: as `Polynomial`.
    """

    coefficients = {1: 1.0}  # noqa: RUF012


class Smooth(Polynomial, name="smooth"):
    """μ(x) = 3t² − 2t³ with t = x/D for x < D, 1 beyond: the smooth step, by 1,025 knots exact to 1e-6.

    Args, Raises: as `Polynomial`.
    """

    coefficients = {2: 3.0, 3: -2.0}  # noqa: RUF012


@dataclass(frozen=True)
class Tabulated(Falloff):
    """Any monotone μ (12.73): values at ascending distances, linear between them, 1 beyond the last.

    Args:
        distances: 2 to 65,536 lengths from 0 on, each larger than the one before; all in mesh units, or all "P%" of
            the bounding-sphere radius.
        values: μ there, from 0 to 1, nowhere falling.

    Raises:
        OptionError: they are no such lists.
    """

    distances: Any
    values: Any

    def __post_init__(self) -> None:
        for name in ("distances", "values"):
            try:
                object.__setattr__(self, name, tuple(np.asarray(getattr(self, name)).tolist()))
            except (TypeError, ValueError):
                raise OptionError(name, "a list of numbers", getattr(self, name)) from None
        distances, _ = _in_one_unit(self.distances)
        values = numbers(self.values, "options", "values", "numbers from 0 to 1")
        if distances.shape != values.shape or not 2 <= len(distances) <= MAX_KNOTS:
            expected = f"one for each of 2 to {MAX_KNOTS:,} distances"
            raise OptionError("values", expected, f"{values.size:,} for {distances.size:,}")
        for name, column, rises, expected in (
            ("distances", distances, distances[1:] > distances[:-1], "finite lengths that ascend from 0"),
            ("values", values, values[1:] >= values[:-1], "numbers that rise from 0 to 1, or stay"),
        ):
            good = np.isfinite(column) & np.append(column[0] == 0, rises)
            if not good.all():
                row = int(np.argmin(good))
                raise OptionError(name, expected, f"{column[row]:g} in row {row + 1:,}")
        if values[-1] != 1:
            raise OptionError("values", "1 at the last distance", f"{values[-1]:g}")

    @classmethod
    def of(cls, function: Function, max_distance: Length | None = None) -> Tabulated:
        """`function` at 1,025 distances, denser towards 0, and between them until linear interpolation errs by at most
        1e-6 in the middle between any two, or there are 65,536.

        Args:
            function: μ of one distance, in mesh units, or in percent of the radius if `max_distance` is; 0 at 0, 1 at
                `max_distance` (both within 1e-6), nowhere falling.
            max_distance: D, a finite length in mesh units or "P%" of the bounding-sphere radius; None: where `function`
                comes within 1e-6 of 1.

        Raises:
            OptionError: `max_distance` is no such length, or `function` no such function.
        """
        limit = None if max_distance is None else _resolve_finite("max_distance", max_distance)
        distances, values = function_knots(function, limit)
        rising = np.clip(np.maximum.accumulate(values), 0, 1)
        rising[[0, -1]] = 0, 1
        wrong = ~(np.abs(rising - values) <= ROUNDING)
        if wrong.any():
            row = int(np.argmax(wrong))
            expected = "values that rise from 0 at distance 0 to 1 at max_distance, or stay"
            raise OptionError("function", expected, f"{values[row]:g} at distance {distances[row]:g}")
        unit = "%" if isinstance(max_distance, str) and max_distance.strip().endswith("%") else ""
        return cls([f"{x!r}%" for x in distances.tolist()] if unit else distances, rising)

    @property
    def max_distance(self) -> Length:
        """The last of the distances."""
        last: Length = self.distances[-1]
        return last

    def resolve(self, radius: float) -> Mu:
        """μ for a mesh of bounding-sphere radius `radius`; its limit is the first distance with the value 1."""
        distances, relative = _in_one_unit(self.distances)
        if relative:
            distances = distances / 100 * (radius or 1.0)
        values = np.asarray(self.values, np.float64)
        count = int(np.argmax(values == 1)) + 1
        return Mu("table", float(distances[count - 1]), knots=_knots(distances[:count], values[:count]))


def _knots(distances: Float64s, values: Float64s) -> tuple[tuple[float, float], ...]:
    """Distances and values as pairs of Python floats."""
    return tuple(zip(distances.tolist(), values.tolist(), strict=True))


def _in_one_unit(distances: Sequence[Any]) -> tuple[Float64s, bool]:
    """Distances as numbers, and whether they are percentages. Raises: OptionError: they are neither."""
    texts = [str(distance).strip() for distance in distances]
    lengths = numbers(
        [text.removesuffix("%") for text in texts], "options", "distances", 'lengths, such as 0.5 or "25%"'
    )
    relative = np.array([text.endswith("%") for text in texts], bool)
    if relative.any() and not (relative | (lengths == 0)).all():
        raise OptionError("distances", "all in mesh units, or all percentages", "some of both")
    return lengths, bool(relative.any())


Falloffs = Falloff | str | Function | Sequence[Falloff | str | Function] | None


def falloffs_of(falloff: Falloffs) -> Falloff | tuple[Falloff, ...]:
    """A falloff or a list's falloffs, also by their names or functions; the exponential one for None.

    Raises: OptionError: neither a falloff nor the name of one, or the list is empty.
    """
    if falloff is None or isinstance(falloff, str | Falloff):
        return _falloff(falloff)
    try:
        falloffs = tuple(map(_falloff, falloff))  # type: ignore[arg-type]
    except TypeError:
        return _falloff(falloff)  # for its message
    if not falloffs:
        raise OptionError("falloff", "a falloff or a list of falloffs", "an empty list", "bake")
    return falloffs


def _falloff(value: Any) -> Falloff:
    """One falloff, also by its name or function. Raises: OptionError."""
    if isinstance(value, Falloff):
        return value
    if isinstance(value, list | tuple | np.ndarray):  # a row of faces
        raise OptionError("mesh", "vertices and faces as a pair, bake((vertices, faces))", "two arguments", "bake")
    without_arguments: dict[Any, Callable[[], Falloff]] = {
        None: Exponential,
        "exponential": Exponential,
        "binary": Binary,
    }
    if value is None or (isinstance(value, str) and value in without_arguments):
        return without_arguments[value]()
    names = sorted(kind.__name__ for kind in FALLOFFS.values())
    classes = ", ".join(f"ao.{name}(…)" for name in (*names, "Tabulated"))
    expected = f'{classes}, a function, "binary" or "exponential"'
    if callable(value) and not isinstance(value, type):
        return Tabulated.of(value)
    near = nearest_name(value, ("exponential", "binary")) if isinstance(value, str) else None
    raise OptionError("falloff", expected, repr(value), "bake", near)
