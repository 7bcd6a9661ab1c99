"""w at several half-distances of the exponential falloff, and by interpolation at every one between them.

w(τ) = 1 − E[e^(−τd)], d the distance to what is hit, ∞ for a miss (12.74); with a limit D all beyond it is a miss.
Weights of columns that suit every single distance d suit every mixture of them, so every mesh: with ten columns an
octave apart no w errs by more than .0036.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from obscurance.raytrace.errors import OptionError, numbers
from obscurance.raytrace.types import Float32s, Float64s

from .falloff import Length, resolve_length

_ROUNDING = 1e-6  # by which a half-distance may lie outside the range, as a share of it
_DISTANCES = 400
_RCOND = 1e-5  # columns much less than an octave apart are combined, which keeps noise small


@dataclass(frozen=True, eq=False)
class Profile:
    """w(p) at k half-distances ln 2/τ of the exponential falloff (12.74).

    Attributes:
        half_distances: float64 (k,), finite, ascending, above 0; mesh units.
        values: float32 (…, k), in [0, 1]: (n, k) of vertices, (h, w, k) of texels.
        radius: of the smallest ball that holds the input, 100 % of relative lengths; mesh units.
        max_distance: limit D of the falloff in mesh units, above 0, or inf.

    Raises:
        OptionError: values of another shape or out of range.
    """

    half_distances: Float64s
    values: Float32s
    radius: float
    max_distance: float = math.inf

    def __post_init__(self) -> None:
        lengths = numbers(self.half_distances, "profile", "half_distances", "numbers")
        rising = lengths.ndim == 1 and len(lengths) > 0 and bool((np.diff(lengths, prepend=0.0) > 0).all())
        if not rising or not np.isfinite(lengths).all():
            raise OptionError("half_distances", "finite lengths above 0, ascending", self.half_distances, "profile")
        values = np.asarray(self.values, np.float32)
        if values.ndim < 2 or values.shape[-1] != len(lengths):
            raise OptionError("values", f"an array of {len(lengths)} columns", f"shape {values.shape}", "profile")
        if not ((values >= 0) & (values <= 1)).all():
            raise OptionError("values", "numbers in [0, 1]", "others", "profile")
        radius = resolve_length("radius", self.radius or 1.0, 1.0)
        limit = resolve_length("max_distance", self.max_distance, 1.0)
        checked = {"half_distances": lengths, "values": values, "radius": radius, "max_distance": limit}
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @classmethod
    def stored(cls, half_distances: Any, values: Any, radius: Any, max_distance: Any = None) -> Profile | None:
        """A profile as a file holds it, or None where it holds something else. Args: max_distance: None: no limit."""
        limit = math.inf if max_distance is None else max_distance
        try:
            return None if np.iscomplexobj(values) else cls(half_distances, np.asarray(values), radius, limit)
        except (OptionError, ValueError, TypeError):
            return None

    @classmethod
    def joined(cls, parts: Sequence[Profile]) -> Profile | None:
        """One profile of the vertices of several, None unless all have the same half-distances."""
        if len({(part.radius, part.max_distance, *part.half_distances) for part in parts}) != 1:
            return None
        return replace(parts[0], values=np.concatenate([part.values for part in parts]))

    @property
    def lengths(self) -> dict[str, Any]:
        """All but the values, for files: `half_distances`, `radius`, and if there is a limit `max_distance`."""
        limit = {} if math.isinf(self.max_distance) else {"max_distance": self.max_distance}
        return {"half_distances": self.half_distances.tolist(), "radius": self.radius} | limit

    def __repr__(self) -> str:
        return f"<Profile of {self.values[..., 0].size:,} values at half-distances {self.range}>"

    @property
    def range(self) -> str:
        """The least and the largest half-distance, in words."""
        least, largest = self.half_distances[[0, -1]]
        percent = 100 / self.radius
        return f"{least:.4g} to {largest:.4g} ({percent * least:.4g} to {percent * largest:.4g} % of the radius)"

    def length(self, half_distance: Length) -> float:
        """A half-distance in mesh units. Raises: OptionError: it is no length, or outside the profile."""
        length = resolve_length("half_distance", half_distance, self.radius)
        least, largest = self.half_distances[[0, -1]]
        if not least * (1 - _ROUNDING) <= length <= largest * (1 + _ROUNDING):
            raise OptionError("half_distance", f"one of the profile's, {self.range}", f"{length:.4g}")
        return float(np.clip(length, least, largest))

    def weights(self, half_distance: Length) -> Float64s:
        """Weights (k,), of sum 1, of the columns: their product with a row interpolates it, exactly at its columns.

        They are the least squares solution for single distances, evenly spread in their logarithm.

        Raises: OptionError: as `length`.
        """
        tau = math.log(2) / self.length(half_distance)
        taus = math.log(2) / self.half_distances
        d = np.append(np.geomspace(self.half_distances[0] / 100, self.half_distances[-1] * 100, _DISTANCES), np.inf)
        weight = np.append(np.ones(_DISTANCES), _DISTANCES / 4)  # a miss stays 1: the weights' sum is 1
        d = np.minimum(d, self.max_distance)
        columns = np.expm1(-taus[:, None] * d) / np.expm1(-taus[:, None] * self.max_distance) * weight
        target = np.expm1(-tau * d) / np.expm1(-tau * self.max_distance) * weight
        solution = np.linalg.lstsq(columns.T, target, rcond=_RCOND)[0]
        return np.asarray(solution / solution.sum())  # which is off by 4e-6 at most: what is open stays exactly 1

    def at(self, half_distance: Length) -> Float64s:
        """w (…,), in [0, 1], at a half-distance in mesh units or as "P%" of the radius.

        Raises: OptionError: it is no length, or outside the profile.
        """
        return np.clip(self.values @ self.weights(half_distance), 0.0, 1.0)
