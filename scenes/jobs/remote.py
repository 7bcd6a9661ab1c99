"""`--cluster`: rays traced, or small meshes of a batch read, baked and written, by the workers of a Dask cluster."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from raytrace.errors import OptionError
from raytrace.types import Int64s

from .bake import MeshBake, Outcome, bake_one, journal, silence_tolerance_warnings
from .console import note, unprinted_warnings
from .options import absolute

if TYPE_CHECKING:
    import ao
    from ao.cluster.session import ClusterSession
    from ao.execute.checkpoint import Checkpoint
    from ao.execute.work import Tables

_BYTES = 50  # of a file, a vertex
_FILES = "mesh", "output", "high", "occluder", "cage"


class Workers:
    """The workers that `--cluster` asks for; they see the folder `--shared`, or that of the output."""

    def __init__(self, options: Mapping[str, Any]) -> None:
        self._address, self._shared, self._threads = (options[name] for name in ("cluster", "shared", "threads"))
        if find_spec("distributed") is None or find_spec("cryptography") is None:
            expected = "Dask and cryptography: pip install dask distributed cryptography"
            raise OptionError("cluster", expected, "not both")
        from ao.cluster.dask_cluster import local_workers

        local_workers(self._address)
        if self._shared is not None and not self._shared.is_dir():
            raise OptionError("shared", "a folder", self._shared)

    def session(self, output: Path) -> ClusterSession:
        from ao.cluster.session import ClusterSession

        shared = output.parent if self._shared is None else self._shared
        return ClusterSession(self._address, shared, output.name, note, self._threads)


def cluster_checkpoint(session: ClusterSession, resume: bool, target: Path | None) -> Checkpoint:
    """Lets workers trace what a target needs, and keeps it beside that; nothing without a target."""
    from ao.execute.checkpoint import Checkpoint

    path = target and journal(target)
    return Checkpoint(path, resume, note, fill_spans=session.fill_spans, status=session.status)


@dataclass(frozen=True, eq=False)
class SharedBakes:
    """Bakes whose files all workers see. Unpickled where they are not seen, it raises OSError."""

    bakes: tuple[MeshBake, ...]  # with absolute names
    falloff: ao.Falloff
    resume: bool

    def __reduce__(self) -> tuple[Callable[..., SharedBakes], tuple[object, ...]]:
        files = [path for bake in self.bakes for path in bake.inputs() if path.exists()]
        folders = {bake.output.parent for bake in self.bakes}
        return _seen, ({*files, *folders}, self.bakes, self.falloff, self.resume)


def _seen(files: set[Path], bakes: tuple[MeshBake, ...], falloff: ao.Falloff, resume: bool) -> SharedBakes:
    for path in sorted(files):
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
    return SharedBakes(bakes, falloff, resume)


@dataclass(frozen=True, eq=False)
class WholeBakes:
    """Bakes to be done, the rows of which are their outcomes."""

    numbers: Int64s  # (k,), places in `SharedBakes.bakes`
    rays: float  # of one, about
    block_rays: ClassVar = 1

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, rows: slice) -> WholeBakes:
        return replace(self, numbers=self.numbers[rows])

    def tables(self) -> Tables:
        return (np.empty(len(self), object),)

    def writer(self, scene: SharedBakes, tables: Tables) -> Callable[[int, int], None]:
        (outcomes,) = tables

        def write(first: int, last: int) -> None:
            for row in range(first, last):
                bake = scene.bakes[self.numbers[row]]
                with unprinted_warnings(), silence_tolerance_warnings():
                    outcomes[row] = asdict(bake_one(bake, scene.falloff, 1, scene.resume))

        return write


def bake_remotely(
    session: ClusterSession, bakes: Sequence[MeshBake], falloff: ao.Falloff, resume: bool, threads: int
) -> Iterator[tuple[int, Outcome]]:
    """Bake by workers, or on threads here if it is little: the place of each bake, and what became of it."""
    if not bakes:
        return
    sizes = np.array([bake.mesh.stat().st_size if bake.mesh.is_file() else 0 for bake in bakes])
    rays = max(sizes.mean() / _BYTES, 1) * (bakes[0].samples or 256)
    work = WholeBakes(np.argsort(-sizes, kind="stable"), float(rays))  # the largest first, to end together
    placed = [bake.replaced(**{name: absolute(getattr(bake, name)) for name in _FILES}) for bake in bakes]
    scene = SharedBakes(tuple(placed), falloff, resume)
    for first, last, (outcomes,) in session.rows(work, scene, threads):
        for place, outcome in zip(work.numbers[first:last].tolist(), outcomes, strict=True):
            yield place, _named_as(bakes[place], _outcome(outcome))


def _outcome(fields: Any) -> Outcome:
    """The outcome as a worker says it, each field of its type."""
    try:
        status: Literal["done", "failed"] = "done" if fields["status"] == "done" else "failed"
        return Outcome(status, float(fields["seconds"]), str(fields["message"]), list(map(str, fields["warnings"])))
    except (TypeError, KeyError, ValueError) as reason:
        return Outcome("failed", 0.0, f"a worker's answer is no outcome of a bake: {reason}")


def _named_as(bake: MeshBake, outcome: Outcome) -> Outcome:
    """The outcome with the names of files as they were given."""

    def given(text: str) -> str:
        for path in (*bake.inputs(), bake.output):
            text = text.replace(str(path.absolute()), str(path))
        return text

    return replace(outcome, message=given(outcome.message), warnings=[given(line) for line in outcome.warnings])
