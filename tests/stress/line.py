"""A result of the stress suite: a case in a pose, what was measured, what is allowed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

MILLION = 1e6
SELF_HITS = 1.0  # a million rays
LEAKS = 5.0  # a million rays
ERROR = 0.004  # of w, beside what a closed form's stand-in is off, at 4,096 rays


@dataclass(frozen=True)
class Line:
    """One result.

    Attributes:
        case, pose: what, and how it lies.
        quantity: what `measured` and `allowed` are: "error", "self-hits/M", …
        measured, allowed: passes if measured ≤ allowed.
        undefined: number of results that are NaN or infinite; none are allowed.
    """

    case: str
    pose: str
    quantity: str
    measured: float
    allowed: float
    undefined: int = 0

    def __str__(self) -> str:
        off = f", {self.undefined} NaN" if self.undefined else ""
        return f"{self.case}, {self.pose}: {self.measured:.3g} {self.quantity}, {self.allowed:.3g} allowed{off}"

    @property
    def ok(self) -> bool:
        """Whether it passes; a NaN does not."""
        return self.measured <= self.allowed and self.undefined == 0


def undefined(*arrays: npt.ArrayLike) -> int:
    """How many values are not finite."""
    return sum(int(np.count_nonzero(~np.isfinite(array))) for array in arrays)
