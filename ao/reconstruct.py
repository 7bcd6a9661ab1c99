"""What neighbouring vertices tell about each other: estimates drawn towards their neighbours' mean by what it is worth.

Each point has an estimate y of variance σ² and a prediction p, the mean of its neighbours' estimates, of mean square
error t². The linear combination of least risk is y + σ²/(σ² + t²) (p − y) (Bates & Granger 1969; with t² taken from
the data, James & Stein 1961). E(y − p)² = σ² + t² wherever the two errors are independent, so t² is what the squared
residuals around a point have beyond σ². As samples grow, σ² vanishes before t² and the estimate is left alone.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .hemisphere import BATCHES
from .neighbours import Neighbours

Floats = npt.NDArray[np.float64]

SPREAD_REACH = 3  # edges over which the spread between batches is averaged
_REACH = 3  # and squared residuals
_OUTLIER = 9.0  # a residual of more than three σ is the point's own


def reconstruct(neighbours: Neighbours, estimate: Floats, variance: Floats) -> tuple[Floats, Floats]:
    """The estimates (k,) drawn towards their neighbours, and the mean square error expected of each, (k,).

    Args: estimate: (k,); variance: (k,), of its sampling error, > 0 where it may be wrong.
    """
    prediction = neighbours.predict(estimate)
    lonely = np.isnan(prediction)
    residual = np.where(lonely, 0.0, estimate - prediction)
    squared = residual**2
    beyond = neighbours.smooth(squared - variance, _REACH)
    error = np.maximum(np.maximum(beyond, squared - _OUTLIER * variance), 0.01 * variance)
    share = np.where(lonely | (variance <= 0), 0.0, variance / np.where(variance > 0, variance + error, 1.0))
    return estimate - share * residual, variance * (1 - share)


def shared_out(spread: Floats, level: float) -> Floats:
    """Variances (k,) of mean `level`, distributed as the `spread` (k,) between each point's batches.

    It is drawn towards its mean by one degree of freedom, so that lucky agreement never reads as certainty.
    """
    typical = float(np.mean(spread)) if len(spread) else 0.0
    if typical == 0:
        return np.full(len(spread), level)
    freedom = BATCHES - 1
    return level / typical * (freedom * spread + typical) / (freedom + 1)
