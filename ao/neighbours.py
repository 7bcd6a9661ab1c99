"""Which points of a mesh are joined by an edge, and means over them that stop at creases."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.jit import inline, kernel

Floats = npt.NDArray[np.float64]
_CREASE = 16  # power of n·n' by which a neighbour counts less


@dataclass(frozen=True, eq=False)
class Neighbours:
    """The one-ring of every point.

    Attributes:
        starts: int64 (k + 1,).
        others: int32 (starts[k],): the neighbours of point i are others[starts[i]:starts[i + 1]], those across an
            inner edge twice, −1 for a corner without one.
        weights: float32, as `others`: how much a neighbour has in common with the point, 1 for the same normal.
    """

    starts: npt.NDArray[np.int64]
    others: npt.NDArray[np.int32]
    weights: npt.NDArray[np.float32]

    @classmethod
    def of(cls, faces: npt.NDArray[np.integer[Any]], normals: npt.NDArray[np.float32]) -> Neighbours:
        """Args: faces: (m, 3), rows of points, −1 for a corner that is none. normals: float32 (k, 3), unit."""
        count = len(normals)
        corners = np.bincount(faces.ravel() + 1, minlength=count + 1)[1:]
        starts = np.concatenate([[0], np.cumsum(2 * corners)])
        others = np.full(starts[-1], -1, np.int32)
        _list(faces, starts[:-1].copy(), others)
        return cls.weighted(starts, others, normals)

    @classmethod
    def weighted(
        cls, starts: npt.NDArray[np.int64], others: npt.NDArray[np.int32], normals: npt.NDArray[np.float32]
    ) -> Neighbours:
        """The rings given, weighted by how the points' `normals`, float32 (k, 3), agree."""
        weights = np.zeros(len(others), np.float32)
        _weigh(starts, others, normals, weights)
        return cls(starts, others, weights)

    def among(self, which: npt.NDArray[np.bool_]) -> Neighbours:
        """The same rings, but only points of `which`, bool (k,), count."""
        return Neighbours(self.starts, self.others, self.weights * which[self.others])

    def predict(self, values: Floats) -> Floats:
        """The weighted mean (k,) of the neighbours' `values` (k,), the point's own left out; NaN without neighbours."""
        out = np.empty(len(values))
        _predict(self.starts, self.others, self.weights, values, out)
        return out

    def smooth(self, values: Floats, rounds: int) -> Floats:
        """`values` (k,) averaged with the neighbours', `rounds` times: about `rounds` edges far."""
        for _ in range(rounds):
            out = np.empty(len(values))
            _smooth(self.starts, self.others, self.weights, values, out)
            values = out
        return values


@kernel
def _list(faces, ends, others):
    for f in range(len(faces)):
        for corner in range(3):
            i = faces[f, corner]
            if i >= 0:
                for step in (1, 2):
                    j = faces[f, (corner + step) % 3]
                    others[ends[i]] = -1 if i == j else j
                    ends[i] += 1


@kernel
def _weigh(starts, others, normals, weights):
    for i in range(len(normals)):
        for k in range(starts[i], starts[i + 1]):
            j = others[k]
            if j >= 0:
                cosine = np.float32(0.0)
                for axis in range(3):
                    cosine += normals[i, axis] * normals[j, axis]
                weights[k] = max(cosine, np.float32(0.0)) ** _CREASE


@inline
def _ring_mean(starts, others, weights, values, i):
    """(Σ w (value − own), Σ w) over the ring of point i: differences, so that equal values stay equal to the bit."""
    total, weight = 0.0, 0.0
    for k in range(starts[i], starts[i + 1]):
        j = others[k]
        if j >= 0:
            total += weights[k] * (values[j] - values[i])
            weight += weights[k]
    return total, weight


@kernel
def _predict(starts, others, weights, values, out):
    for i in range(len(values)):
        total, weight = _ring_mean(starts, others, weights, values, i)
        out[i] = values[i] + total / weight if weight > 1e-6 else np.nan


@kernel
def _smooth(starts, others, weights, values, out):
    for i in range(len(values)):
        total, weight = _ring_mean(starts, others, weights, values, i)
        out[i] = values[i] + total / (weight + 2.0)  # others are listed twice
