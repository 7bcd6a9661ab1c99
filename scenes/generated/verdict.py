"""What is allowed on unseen meshes, and the table that tells it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom

from .suite import Outcome

KEPT = 0.95  # of all runs, at least


@dataclass(frozen=True)
class Limits:
    """What a group of runs may be at most.

    Attributes:
        missed: number of runs whose true error is above the tolerance, by the number of runs: at most the quantile
            `missed` of the misses of a baker that keeps it with chance `KEPT`; None: no more than that share.
        told: factor by which the root mean square errors, told and true, of all runs together may differ.
        worst: the same, of the worst run's true error over the tolerance and over the error told, or a quarter of the
            tolerance where that is more: few vertices have what is left where nearly all of a mesh is open.
        largest: a vertex's error, in tolerances.
        beyond: share of vertices off by more than 2.5 and than 6 times the error told for them.
    """

    missed: float | None = None
    told: float = 1.4
    worst: float = float("inf")
    largest: float = 20.0
    beyond: tuple[float, float] = (0.05, 0.001)


LIMITS = Limits()  # of many runs of one family
FEW = Limits(missed=5e-4, worst=2.0, largest=40.0, beyond=(0.07, 0.002))  # of a few runs of some families


@dataclass(frozen=True)
class Verdict:
    """A group of runs against its limits. Attributes: name: of the group. runs, kept: how many. faults: what is off."""

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
        """Whether nothing is off."""
        return not self.faults


def kept(outcome: Outcome) -> bool:
    """Whether the true error is within the tolerance."""
    return outcome.figures.true <= outcome.case.tolerance


def verdict(name: str, outcomes: Sequence[Outcome], limits: Limits) -> Verdict:
    """All `outcomes`, at least one, against `limits`."""
    figures = [outcome.figures for outcome in outcomes]
    tolerances = np.array([outcome.case.tolerance for outcome in outcomes])
    true, told = (np.array([getattr(f, field) for f in figures]) / tolerances for field in ("true", "told"))
    ratio = float(np.sqrt(np.sum(true**2) / np.sum(told**2))) if told.any() else float("inf") if true.any() else 1.0
    vertices = sum(f.vertices for f in figures)
    beyond = tuple(sum(f.beyond[k] for f in figures) / max(vertices, 1) for k in (0, 1))
    missed, worst = sum(not kept(o) for o in outcomes), float(np.max(true / np.minimum(np.maximum(told, 0.25), 1.0)))
    largest = max(float(f.largest) / t for f, t in zip(figures, tolerances, strict=True))
    allowed = len(outcomes) * (1 - KEPT) if limits.missed is None else binom.isf(limits.missed, len(outcomes), 1 - KEPT)
    faults = [
        text
        for off, text in (
            (missed > allowed, f"tolerance missed in {missed} of {len(outcomes)}"),
            (not 1 / limits.told <= ratio <= limits.told, f"true/told {ratio:.2f}"),
            (not worst <= limits.worst, f"a run {worst:.2f} times what it told or was asked for"),
            (not largest <= limits.largest, f"a vertex off by {largest:.0f} tolerances"),
            (beyond[0] > limits.beyond[0], f"{beyond[0]:.2%} of errors beyond 2.5 times what is told"),
            (beyond[1] > limits.beyond[1], f"{beyond[1]:.3%} of errors beyond 6 times what is told"),
            (any(f.undefined for f in figures), "NaN"),
        )
        if off
    ]
    rays = float(np.mean([f.rays for f in figures]))
    return Verdict(
        name, len(figures), len(figures) - missed, ratio, largest, (beyond[0], beyond[1]), rays, tuple(faults)
    )


def verdicts(outcomes: Sequence[Outcome], limits: Limits) -> list[Verdict]:
    """A verdict for each family, in order."""
    names = dict.fromkeys(outcome.case.family for outcome in outcomes)
    return [verdict(name, [o for o in outcomes if o.case.family == name], limits) for name in names]


HEAD = (
    f"{'family':32}  {'seed':>10}  {'falloff':16}  {'asked':>5}  {'true':>7}  {'told':>7}  {'ratio':>5}  "
    f"{'largest':>7}  {'>2.5':>6}  {'>6':>7}  {'outstanding':>11}  {'vertices':>8}  {'rays':>6}  kept"
)


def row(outcome: Outcome) -> str:
    """A line of the table: one run."""
    c, f = outcome.case, outcome.figures
    beyond = [count / max(f.vertices, 1) for count in f.beyond]
    return (
        f"{c.family:32.32}  {c.seed:10}  {outcome.kind:16}  {c.tolerance:5g}  {f.true:7.5f}  {f.told:7.5f}  "
        f"{f.ratio:5.2f}  {f.largest:7.4f}  {beyond[0]:6.2%}  {beyond[1]:7.3%}  {f.outstanding:11}  {f.vertices:8}  "
        f"{f.rays:6.1f}  {'yes' if kept(outcome) else 'NO'}"
    )


def table(found: Sequence[Verdict]) -> str:
    """Verdicts as lines of text, with a count at the end."""
    head = f"{'family':32}  {'kept':>7}  {'ratio':>5}  {'largest':>7}  {'>2.5':>6}  {'>6':>7}  {'rays':>6}  verdict"
    rows = [
        f"{v.name:32.32}  {f'{v.kept}/{v.runs}':>7}  {v.ratio:5.2f}  {v.largest:6.1f}t  {v.beyond[0]:6.2%}  "
        f"{v.beyond[1]:7.3%}  {v.rays:6.1f}  {'ok' if v.ok else 'FAILED: ' + '; '.join(v.faults)}"
        for v in found
    ]
    failed = sum(not v.ok for v in found)
    return "\n".join([head, *rows, f"{failed} of {len(found)} failed" if failed else f"all {len(found)} ok"])
