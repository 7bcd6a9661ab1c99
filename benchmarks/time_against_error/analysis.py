"""From measured runs to the time that a wanted error takes, speed-ups and their means."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import Any

TARGETS = (0.01, 0.004)
LEAST_SLOPE = -0.4  # a curve that ends flatter is held up by a bias and is not continued; random rays have −1/2


@dataclass(frozen=True)
class Point:
    """One rung of a method's ladder on one mesh and falloff, all rounds together: medians, and the range of seconds."""

    setting: float
    seconds: float
    fastest: float
    slowest: float
    build: float
    rmse: float
    p99: float
    largest: float
    mean: float

    @classmethod
    def of(cls, run: dict[str, Any]) -> Point:
        """Of a run's `setting`, and its `seconds`, `build`, `rmse`, `p99`, `largest` and `mean`, lists over rounds."""
        times = run["seconds"]
        middle = {name: median(run[name]) for name in ("build", "rmse", "p99", "largest", "mean")}
        return cls(run["setting"], median(times), min(times), max(times), **middle)


Curves = dict[tuple[str, str], dict[str, list[Point]]]


def curves(runs: Iterable[dict[str, Any]]) -> Curves:
    """Points of every method, by (mesh, falloff) and method, in the order measured."""
    found: Curves = {}
    for run in runs:
        found.setdefault((run["mesh"], run["falloff"]), {}).setdefault(run["method"], []).append(Point.of(run))
    return found


@dataclass(frozen=True)
class TimeTo:
    """Seconds until a wanted RMSE, and how they were found.

    Attributes:
        how: "between" two measured points; "beyond" the best one, from the last two; "below": already the cheapest
            run is better than asked, and its time is what it takes.
    """

    seconds: float
    how: str


def time_to(points: Sequence[Point], rmse: float) -> TimeTo | None:
    """Seconds a method needs for `rmse`: its curve, straight between measured points in log–log.

    Args: points: in the order of the ladder, from fast to good.

    None where the curve cannot tell: no points, or an end above `rmse` that falls no faster than `LEAST_SLOPE`.
    """
    if not points:
        return None
    if points[0].rmse <= rmse:
        return TimeTo(points[0].seconds, "below")
    for a, b in pairwise(points):
        if b.rmse <= rmse:
            return TimeTo(_along(a, b, rmse) if b.rmse > 0 else b.seconds, "between")
    return _beyond(points[-2], points[-1], rmse) if len(points) > 1 else None


def _beyond(a: Point, b: Point, rmse: float) -> TimeTo | None:
    """On past `b`: RMSE by a power of the effort, seconds in proportion to it beyond their fixed part.

    The effort is the setting, where it rises as rays do, and else the seconds themselves.
    """
    effort = (a.setting, b.setting) if b.setting > a.setting else (a.seconds, b.seconds)
    if effort[1] <= effort[0]:
        return None
    power = math.log(b.rmse / a.rmse) / math.log(effort[1] / effort[0])
    if power > LEAST_SLOPE:
        return None
    wanted = effort[1] * (rmse / b.rmse) ** (1 / power)
    rate = max((b.seconds - a.seconds) / (effort[1] - effort[0]), 0.0)
    return TimeTo(b.seconds + rate * (wanted - effort[1]), "beyond")


def _along(a: Point, b: Point, rmse: float) -> float:
    part = math.log(a.rmse / rmse) / math.log(a.rmse / b.rmse)
    return math.exp(math.log(a.seconds) + part * math.log(b.seconds / a.seconds))


def best(times: Iterable[TimeTo | None]) -> TimeTo | None:
    """The shortest of those that are known."""
    return min((time for time in times if time), key=lambda time: time.seconds, default=None)


def speed_up(ours: TimeTo | None, theirs: TimeTo | None) -> float | None:
    """How many times as long they take, or None where a time is not known."""
    return theirs.seconds / ours.seconds if ours and theirs else None


def geometric_mean(values: Iterable[float | None]) -> float | None:
    """Of the values that are known; None without any."""
    logs = [math.log(value) for value in values if value is not None]
    return math.exp(sum(logs) / len(logs)) if logs else None
