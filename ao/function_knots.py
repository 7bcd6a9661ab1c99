"""A function of the distance as knots, dense where it bends."""

from collections.abc import Callable

import numpy as np

from raytrace.errors import OptionError, numbers
from raytrace.types import Float64s

MAX_KNOTS = 1 << 16
STEPS = 1024
ROUNDING = 1e-6  # by which knots may miss a function, and that 0, 1 and monotony
Function = Callable[[float], float]


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
    values = [function(distance) for distance in distances.tolist()]
    return numbers(values, "options", "function", "a number at every distance")


def _reach(function: Function) -> float:
    """Of distances from 1e-12 to 1e12, in steps of 1 %, the first at which a function is 1 within a rounding."""
    for distance in 1.01 ** np.arange(-2777.0, 2778.0):
        if _sampled(function, np.array([distance]))[0] >= 1 - ROUNDING:
            return float(distance)
    expected = "values that reach 1, or ao.Tabulated.of(function, max_distance)"
    raise OptionError("function", expected, "values below 1 up to a distance of 1e12")
