"""A line of the stress table: a case in a pose, what was measured, what is allowed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

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


def table(lines: Sequence[Line]) -> str:
    """The lines as text, aligned, with a count at the end."""
    texts = [
        (line.case, line.pose, line.quantity, f"{line.measured:.3g}", f"{line.allowed:.3g}", str(line.undefined),
         "ok" if line.ok else "FAILED")
        for line in lines
    ]  # fmt: skip
    head = ("case", "pose", "quantity", "measured", "allowed", "NaN", "verdict")
    widths = [max(map(len, column)) for column in zip(head, *texts, strict=True)]
    rows = [
        "  ".join(
            text.rjust(width) if 3 <= k <= 5 else text.ljust(width)
            for k, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in (head, *texts)
    ]
    failed = sum(not line.ok for line in lines)
    rows.append(f"{failed} of {len(lines)} failed" if failed else f"all {len(lines)} within what is allowed")
    return "\n".join(rows)
