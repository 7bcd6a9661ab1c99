"""`--cluster` with a batch: small meshes are read, baked and written by the workers of a Dask cluster."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from .console import unprinted_warnings
from .plan import Plan
from .run import Outcome, run_in_batch, silence_tolerance_warnings

if TYPE_CHECKING:
    from obscurance.ao.cluster.workers import SharedScene, Workers


def run_remotely(workers: Workers, plans: Sequence[Plan]) -> Iterator[tuple[int, Outcome]]:
    """Bake by workers, which see all files under the same names: the row of each plan, and what became of it."""
    sizes = [plan.mesh.stat().st_size if plan.mesh.is_file() else 0 for plan in plans]
    rows = sorted(range(len(plans)), key=lambda row: -sizes[row])  # the largest come before, to end together
    for number, fields in workers.map(_bake, (), lambda number: plans[rows[number]].absolute(), len(plans)):
        yield rows[number], _named_as(plans[rows[number]], _outcome(fields))


def _bake(_: SharedScene, plan: Plan) -> tuple[object, ...]:
    """Bake one mesh on a worker. Raises: FileNotFoundError: a folder is not seen from here."""
    for folder in (plan.mesh.parent, plan.output.parent):
        if not folder.is_dir():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(folder))
    with unprinted_warnings(), silence_tolerance_warnings():
        return tuple(run_in_batch(plan, 1))


def _outcome(fields: Any) -> Outcome:
    """The `Outcome` of the fields that a worker sends, each checked for its type."""
    from obscurance.raytrace.system.records import Fault, read

    try:
        return read(Outcome, dict(zip(Outcome._fields, fields, strict=True)))
    except (Fault, TypeError, ValueError):
        return Outcome("failed", 0.0, "a worker's answer is no outcome of a bake", [])


def _named_as(plan: Plan, outcome: Outcome) -> Outcome:
    """The outcome, with files named in its message and warnings as the plan has them."""

    def given(text: str) -> str:
        """A text with the names of files as they were given, in place of absolute ones."""
        for path in (*plan.inputs, plan.output):
            text = text.replace(str(path.absolute()), str(path))
        return text

    return outcome._replace(message=given(outcome.message), warnings=[given(line) for line in outcome.warnings])
