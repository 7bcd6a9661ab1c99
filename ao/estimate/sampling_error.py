"""What rays alone err by, and keys and choices of points for measuring it."""

import numpy as np

from obscurance.raytrace.sampling import hash32_array
from obscurance.raytrace.types import Float64s, Int64s

BATCH = 4  # rays are added in multiples of it
RATE = 1.5  # the variance of n rays falls as n^−1.5
TYPICAL, PRIOR = 0.09, 8  # variance of n rays · n^1.5, and how many points this prior is worth: a few may agree by luck


def sampling_variance(one: Float64s, other: Float64s, rays: int) -> float:
    """Mean square error of either of two independent estimates (k,) with `rays` rays a point."""
    halves = float(np.sum((one - other) ** 2)) / 2
    return float((halves + PRIOR * TYPICAL * rays**-RATE) / (len(one) + PRIOR))


def rays_alone(tolerance: float) -> int:
    """Rays by which a point errs by the `tolerance` without help from other points'."""
    enough = float(TYPICAL / tolerance**2) ** (1 / RATE)
    return int(BATCH * max(round(enough / BATCH), 1))


def derive(key: np.uint32, salt: int) -> np.uint32:
    """A key of directions that are independent of the directions of `key`."""
    return np.uint32(hash32_array(hash32_array([salt]) ^ key)[0])


def stratified_rows(count: int, wanted: int) -> Int64s:
    """`wanted` of `count` rows, one from each equal stretch of Morton order, all if there are no more; ascending."""
    wanted = min(count, wanted)
    bounds = np.arange(wanted + 1) * count // max(wanted, 1)
    chance = np.ldexp(hash32_array(np.arange(wanted, dtype=np.uint32)).astype(np.float64), -32)
    return bounds[:-1] + (chance * np.diff(bounds)).astype(np.int64)
