"""`--cluster`: rays traced, or small meshes of a batch read, baked and written, by the workers of a Dask cluster."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from raytrace.errors import OptionError
from raytrace.types import Int64s

from .console import note, unprinted_warnings
from .options import OptionValues
from .plan import Plan
from .run import Outcome, journal_of, run_in_batch, silence_tolerance_warnings

if TYPE_CHECKING:
    from ao.cluster.session import ClusterSession
    from ao.execute.checkpoint import Checkpoint
    from ao.execute.work import Outputs

_BYTES = 50  # of a file, a vertex


class Workers:
    """The workers that `--cluster` asks for; they see the folder `--shared`, or that of the output."""

    def __init__(self, options: OptionValues) -> None:
        self._address = options.cluster
        self._shared = options.shared
        self._threads = options.threads
        if find_spec("distributed") is None or find_spec("cryptography") is None:
            expected = "Dask and cryptography: pip install dask distributed cryptography"
            raise OptionError("cluster", expected, "not both")
        from ao.cluster.dask_cluster import local_workers

        local_workers(self._address)
        if self._shared is not None and not self._shared.is_dir():
            raise OptionError("shared", "a folder", self._shared)

    def session(self, output: Path) -> ClusterSession:
        """A session of the workers, for a bake into `output`."""
        from ao.cluster.session import ClusterSession

        shared = output.parent if self._shared is None else self._shared
        return ClusterSession(self._address, shared, output.name, note, self._threads)


def cluster_checkpoint(session: ClusterSession, resume: bool, target: Path | None) -> Checkpoint:
    """Lets workers trace what a target needs, and keeps it beside that; nothing without a target."""
    from ao.execute.checkpoint import Checkpoint

    path = target and journal_of(target)
    return Checkpoint(path, resume, note, fill_spans=session.fill_spans, status=session.status)


@dataclass(frozen=True, eq=False)
class SharedPlans:
    """Plans whose files all workers see, with absolute names. Unpickled where they are not seen, it raises OSError."""

    plans: tuple[Plan, ...]

    def __reduce__(self) -> tuple[Callable[..., SharedPlans], tuple[object, ...]]:
        files = [path for plan in self.plans for path in plan.inputs if path.exists()]
        folders = [plan.output.parent for plan in self.plans]
        return _seen, ({*files, *folders}, self.plans)


def _seen(files: set[Path], plans: tuple[Plan, ...]) -> SharedPlans:
    """Unpickle `SharedPlans`. Raises: FileNotFoundError: a file is not seen from here."""
    for path in sorted(files):
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    return SharedPlans(plans)


@dataclass(frozen=True, eq=False)
class WholeBakes:
    """Whole bakes as a `RowTask`: each row is the outcome of one."""

    numbers: Int64s  # (k,), places in `SharedPlans.plans`
    rays: float  # of one, about
    block_rays: ClassVar = 1

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, rows: slice) -> WholeBakes:
        return replace(self, numbers=self.numbers[rows])

    def tables(self) -> Outputs:
        return (np.empty(len(self), object),)

    def writer(self, scene: SharedPlans, tables: Outputs) -> Callable[[int, int], None]:
        (outcomes,) = tables

        def write(start: int, stop: int) -> None:
            for row in range(start, stop):
                with unprinted_warnings(), silence_tolerance_warnings():
                    outcomes[row] = run_in_batch(scene.plans[self.numbers[row]], 1)._asdict()

        return write


def run_remotely(session: ClusterSession, plans: Sequence[Plan], threads: int) -> Iterator[tuple[int, Outcome]]:
    """Bake by workers, or on threads here if it is little: the row of each plan, and what became of it."""
    if not plans:
        return
    sizes = np.array([plan.mesh.stat().st_size if plan.mesh.is_file() else 0 for plan in plans])
    rays = max(sizes.mean() / _BYTES, 1) * (plans[0].options.samples or 256)
    work = WholeBakes(np.argsort(-sizes, kind="stable"), float(rays))  # the largest come before, to end together
    scene = SharedPlans(tuple(plan.absolute() for plan in plans))
    for start, stop, (outcomes,) in session.rows(work, scene, threads):
        for row, outcome in zip(work.numbers[start:stop].tolist(), outcomes, strict=True):
            yield row, _named_as(plans[row], _outcome(outcome))


def _outcome(fields: Any) -> Outcome:
    """The `Outcome` of the fields that a worker sends, each checked for its type."""
    from raytrace.system.records import Fault, read

    try:
        return read(Outcome, fields)
    except Fault:
        return Outcome("failed", 0.0, "a worker's answer is no outcome of a bake", [])


def _named_as(plan: Plan, outcome: Outcome) -> Outcome:
    """The outcome, with files named in its message and warnings as the plan has them."""

    def given(text: str) -> str:
        """A text with the names of files as they were given, in place of absolute ones."""
        for path in (*plan.inputs, plan.output):
            text = text.replace(str(path.absolute()), str(path))
        return text

    return outcome._replace(message=given(outcome.message), warnings=[given(line) for line in outcome.warnings])
