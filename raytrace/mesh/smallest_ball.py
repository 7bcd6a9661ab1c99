"""The smallest ball that holds points: neither turning them nor a finer mesh of the same surface changes it."""

import itertools

import numpy as np

from ..system.parallel import each
from ..types import Bools, Float64Rows, Float64s

_ROUNDING = 1e-12  # of squared lengths, relative to the largest extent's
_SAMPLE = 4096
_BLOCK = 1 << 14  # points
_CHOICES = np.array([chosen for chosen in itertools.product((0.0, 1.0), repeat=4) if sum(chosen) < 4])


def smallest_ball(points: Float64s) -> tuple[Float64s, float]:
    """Centre (3,) and radius of the smallest ball about `points` (n, 3), n > 0.

    It is found of a sample first, then of the points that carry the ball and all outside of it, until nothing is
    outside (Clarkson 1995).
    """
    points = np.ascontiguousarray(points, np.float64)
    size = float(max(np.ptp(column) for column in points.T)) or 1.0
    sampled = (points[:: -(-len(points) // _SAMPLE)] - points[0]) / size
    square = -1.0
    carriers = sampled[:1]
    outside = np.empty(len(points), np.bool_)
    largest = np.empty(-(-len(points) // _BLOCK))
    while True:
        before = square
        centre, square, carriers = _pivot(sampled, carriers)
        _look_outside(points, size, centre, square + _ROUNDING, outside, largest)
        if not outside.any() or square <= before:
            return points[0] + size * centre, size * float(np.sqrt(largest.max()))
        sampled = (points[outside] - points[0]) / size


@each("largest", 1)
def _look_outside(
    block: int,
    points: Float64Rows,
    size: float,
    centre: Float64s,
    square: float,
    outside: Bools,
    largest: Float64s,
) -> None:
    """Which points are outside of a ball, in units of `size` from the first of them; the largest square of a block."""
    most = 0.0
    for i in range(block * _BLOCK, min((block + 1) * _BLOCK, len(points))):
        total = 0.0
        for axis in range(3):
            total += ((points[i, axis] - points[0, axis]) / size - centre[axis]) ** 2
        outside[i] = total > square
        most = max(most, total)
    largest[block] = most


def _pivot(points: Float64s, carriers: Float64s) -> tuple[Float64s, float, Float64s]:
    """Centre, squared radius and carriers (k, 3), up to four points on its surface, of the smallest ball about `points`
    and the `carriers` of a smaller one: the farthest point joins them until none is outside, or the ball no longer
    grows (Gärtner 1999, "Fast and Robust Smallest Enclosing Balls")."""
    centre = carriers[0]
    square = 0.0
    before = -1.0
    while square > before:
        squares = _squares(points - centre)
        if squares.max() <= square + _ROUNDING:
            break
        before = square
        centre, square, carriers = _through(points[squares.argmax()], carriers)
    return centre, square, carriers


def _through(outside: Float64s, carriers: Float64s) -> tuple[Float64s, float, Float64s]:
    """The smallest ball through a point `outside` of the ball of `carriers` that holds these: centre, squared
    radius, carriers.

    It is the smallest of the balls through the point and some of the carriers that hold all of them.
    """
    around = carriers - outside
    subsets = _CHOICES[:, : len(around), None] * around
    halves = _squares(subsets)[..., None] / 2
    offsets = (np.linalg.pinv(subsets, rcond=1e-9) @ halves)[..., 0]  # in the span of those chosen
    squares = _squares(offsets)
    away = _squares(around - offsets[:, None]).max(axis=1)
    best = np.where(away <= squares + _ROUNDING, squares, np.inf).argmin()
    new_carriers = carriers[_CHOICES[best, : len(around)] > 0]
    return outside + offsets[best], float(squares[best]), np.append(new_carriers, outside[None], axis=0)


def _squares(offsets: Float64s) -> Float64s:
    """Squared lengths (…) of vectors (…, 3)."""
    return np.asarray(np.einsum("...i,...i->...", offsets, offsets))
