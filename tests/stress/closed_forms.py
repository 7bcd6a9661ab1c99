"""Closed forms of the validation table in poses, a line for the one nearest to its limit."""

from __future__ import annotations

from collections.abc import Iterator

from shared_directions import only_w

from obscurance.scenes.validation.table import compare, configurations, described, measure

from .line import Line, undefined
from .pose import poses


def closed_forms(long: bool) -> Iterator[Line]:
    """A line for each pose: of every closed form, or of another twelfth in each of the three that are few."""
    for number, pose in enumerate(poses(long)):
        found, missing = [], 0
        lines = configurations() if long else configurations()[4 * number :: 12]
        posed_lines = [pose.configuration(line) for line in lines]
        with only_w():
            measurements = [measure(posed) for posed in posed_lines]
        for line, posed, measured in zip(lines, posed_lines, measurements, strict=True):
            missing += undefined(measured)
            result = compare(posed, measured)
            case = f"{len(lines)} closed forms, worst: {line.name}, {described(line.falloff)}"
            found.append(Line(case, str(pose), "error of w", abs(result.error), result.allowed))
        worst = max(found, key=lambda line: (not line.ok, line.measured / max(line.allowed, 1e-9)))
        yield Line(worst.case, worst.pose, worst.quantity, worst.measured, worst.allowed, missing)
