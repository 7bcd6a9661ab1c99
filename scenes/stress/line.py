"""A line of the stress table: a case in a pose, what was measured, what is allowed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..validation.text_table import count_failures, text_table

MILLION = 1e6
SELF_HITS = 1.0  # a million rays
LEAKS = 5.0  # a million rays
ERROR = 0.004  # of w, beside what a closed form's stand-in is off, at 4,096 rays


@dataclass(frozen=True)
class Line:
    """One line of the table.

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

    @property
    def ok(self) -> bool:
        """Whether it passes; a NaN does not."""
        return self.measured <= self.allowed and self.undefined == 0


def undefined(*arrays: npt.ArrayLike) -> int:
    """How many values are not finite."""
    return sum(int(np.count_nonzero(~np.isfinite(array))) for array in arrays)


def stress_table(lines: Sequence[Line]) -> str:
    """The lines as text, aligned, with a count at the end."""
    head = ("case", "pose", "quantity", "measured", "allowed", "NaN", "verdict")
    rows = [
        (line.case, line.pose, line.quantity, f"{line.measured:.3g}", f"{line.allowed:.3g}", str(line.undefined),
         "ok" if line.ok else "FAILED")
        for line in lines
    ]  # fmt: skip
    text = text_table(head, rows, head[3:6])
    return "\n".join([*text, count_failures([line.ok for line in lines], "within what is allowed")])
