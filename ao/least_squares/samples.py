"""Sample points on a surface, spread evenly by area along the order of its faces."""

from typing import NamedTuple, Self

import numpy as np

from raytrace.kernel.jit import inline
from raytrace.types import Float64s, Int64s

GOLDEN = 0.6180339887498949
_EVEN = 0.2  # a fifth more samples, the same number for every face, so that small faces have some


class Samples(NamedTuple):
    """A Fibonacci lattice laid over faces one after the other.

    Between 0 and `count`, sample k lies at k + shift, which determines its face and, within it, one coordinate; the
    other is the fractional part of k/golden ratio. So samples are evenly spread on each face, whatever their number,
    and over neighbouring faces that hold less than one each.

    Attributes:
        shift: in [0, 1).
        ends: float64 (m + 1,), where each face begins between 0 and `count`.
        starts: int64 (m + 1,), the first sample on each.
        weights: float64 (m,), the share of the area that a sample on each stands for.
    """

    shift: float
    ends: Float64s
    starts: Int64s
    weights: Float64s

    @classmethod
    def spread(cls, areas: Float64s, count: int, shift: float) -> Self:
        """`count` samples over faces of `areas` (m,), above 0, in Morton order."""
        share = areas / areas.sum()
        ends = np.concatenate([[0.0], np.cumsum(share + _EVEN / len(share))])
        ends *= count / ends[-1]
        starts = np.clip(np.ceil(ends - shift), 0, count).astype(np.int64)
        starts[-1] = count
        return cls(shift, ends, starts, share / np.diff(ends))

    def of_faces(self, first: int, last: int) -> Self:
        """The samples on the faces from a first one to a last one."""
        ends, starts = self.ends[first : last + 1], self.starts[first : last + 1]
        return self._replace(ends=ends, starts=starts, weights=self.weights[first:last])


@inline
def place(k, shift, begin, end):
    """Barycentric coordinates of sample `k` on the face that extends from `begin` to `end` (Turk 1990)."""
    s = np.sqrt(min(max((k + shift - begin) / (end - begin), 0.0), 1.0))
    v = (k * GOLDEN) % 1.0
    return 1.0 - s, s * (1.0 - v), s * v
