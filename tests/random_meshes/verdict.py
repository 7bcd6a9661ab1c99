"""Limits for bakes of random meshes, and whether a group of bakes keeps them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from .suite import Outcome

KEPT = 0.95  # of all bakes, at least


@dataclass(frozen=True)
class Limits:
    """What a group of bakes may be at most.

    Attributes:
        missed: number of bakes whose true error is above the tolerance, by the number of bakes: at most the quantile
            `missed` of the misses of a baker that keeps it with chance `KEPT`; None: no more than that share.
        ratio: factor by which the root mean square errors, estimated and true, of all bakes together may differ.
        worst: the same, of the worst bake's true error over the tolerance and over the estimated error, or a quarter
            of the tolerance where that is more: few vertices have an error at all where nearly all of a mesh is open.
        largest: a vertex's error, in tolerances.
        beyond: share of vertices off by more than 2.5 and than 6 times their estimated error.
    """

    missed: float | None = None
    ratio: float = 1.4
    worst: float = float("inf")
    largest: float = 20.0
    beyond: tuple[float, float] = (0.05, 0.001)


LIMITS = Limits()  # of many bakes of one family
FEW = Limits(missed=5e-4, worst=2.0, largest=40.0, beyond=(0.07, 0.002))  # of a few bakes of some families


@dataclass(frozen=True)
class Verdict:
    """A group of bakes against its limits.

    Attributes:
        name: of the group. runs, kept: how many bakes, and how many keep the tolerance.
        ratio: true over estimated root mean square error. largest: a vertex's error, in tolerances.
        beyond: see `Limits`. rays: a vertex, mean. faults: the limits that are broken, in words.
    """

    name: str
    runs: int
    kept: int
    ratio: float
    largest: float
    beyond: tuple[float, float]
    rays: float
    faults: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether no limit is broken."""
        return not self.faults


def kept(outcome: Outcome) -> bool:
    """Whether the true error is within the tolerance."""
    return outcome.figures.true <= outcome.case.tolerance


def verdict(name: str, outcomes: Sequence[Outcome], limits: Limits) -> Verdict:
    """All `outcomes`, at least one, against `limits`."""
    figures = [outcome.figures for outcome in outcomes]
    tolerances = np.array([outcome.case.tolerance for outcome in outcomes])
    true = np.array([f.true for f in figures]) / tolerances
    estimated = np.array([f.estimated for f in figures]) / tolerances
    if estimated.any():
        ratio = float(np.sqrt(np.sum(true**2) / np.sum(estimated**2)))
    else:
        ratio = float("inf") if true.any() else 1.0
    worst = float(np.max(true / np.clip(estimated, 0.25, 1.0)))
    vertices = max(sum(f.vertices for f in figures), 1)
    near, far = (sum(f.beyond[k] for f in figures) / vertices for k in (0, 1))
    missed = sum(not kept(outcome) for outcome in outcomes)
    allowed = len(outcomes) * (1 - KEPT) if limits.missed is None else binom.isf(limits.missed, len(outcomes), 1 - KEPT)
    largest = max(float(f.largest) / t for f, t in zip(figures, tolerances, strict=True))
    checks = (
        (missed > allowed, f"tolerance missed in {missed} of {len(outcomes)}"),
        (not 1 / limits.ratio <= ratio <= limits.ratio, f"true/estimated error {ratio:.2f}"),
        (not worst <= limits.worst, f"an error {worst:.2f} times its estimate or the tolerance"),
        (not largest <= limits.largest, f"a vertex off by {largest:.0f} tolerances"),
        (near > limits.beyond[0], f"{near:.2%} of errors beyond 2.5 times their estimate"),
        (far > limits.beyond[1], f"{far:.3%} of errors beyond 6 times their estimate"),
        (any(f.undefined for f in figures), "NaN"),
    )
    faults = tuple(text for is_off, text in checks if is_off)
    rays = float(np.mean([f.rays for f in figures]))
    return Verdict(name, len(figures), len(figures) - missed, ratio, largest, (near, far), rays, faults)
