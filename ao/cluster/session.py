"""A connection to workers for one command, which traces one work after the other in one scene after the other."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from raytrace.types import Bools

from ..execute.checkpoint import spans_of
from ..execute.identity import machine
from ..execute.work import Work, fill
from .dask_cluster import DaskCluster, Found
from .scene_file import SceneFile, write_scene

_FEW = 1 << 19  # rays that are traced here: to send them takes as long


class ClusterSession:
    """The workers of a Dask cluster, in a `with` block.

    Args:
        address: `local`, `local:N` or a scheduler's, `tls://host:port`.
        shared: a folder that all workers see under this name, for scenes. name: of their files, the output's.
        notify: called with a line for the user.
        threads: of all workers on this machine together; None: all cores.

    Attributes:
        cluster: the workers.

    Raises, when the block is entered:
        OptionError: there is no scheduler at the address.
    """

    def __init__(
        self, address: str, shared: Path, name: str, notify: Callable[[str], object], threads: int | None = None
    ) -> None:
        self.cluster = DaskCluster(address, threads, notify)
        self._shared, self._name = shared, name
        self._scene: Callable[[], object] = lambda: None  # a weak reference: it may be large
        self._file: SceneFile | None = None

    def __enter__(self) -> ClusterSession:
        if self.cluster.workers is None:
            self.cluster.connect()
        return self

    def worth(self, work: Work, rows: int) -> bool:
        """Whether so many rows are better traced by workers than here."""
        return rows * work.rays >= _FEW

    def trace(self, work: Work, scene: Any, missing: Bools) -> Iterator[Found]:
        """The `missing` rows, bool (k,), of `work` in a scene, in blocks as they come: first row, last row, tables.

        Raises:
            OutputError: the scene's file cannot be written.
            InputError, ClusterError: as `DaskCluster.trace`.
        """
        if self._scene() is not scene:
            self._remove()
            self._file = write_scene(self._shared, self._name, scene)
            self._scene = weakref.ref(scene)
            self.cluster.use(self._file, machine())
        yield from self.cluster.trace(work, spans_of(missing))

    def rows(self, work: Work, scene: Any, threads: int) -> Iterator[Found]:
        """All rows of `work` in blocks, by workers or, if they are few, by so many threads here. Errors as `trace`."""
        if self.worth(work, len(work)):
            yield from self.trace(work, scene, np.ones(len(work), np.bool_))
        else:
            tables = work.tables()
            fill(work, scene, tables, threads)
            yield 0, len(work), tables

    def status(self) -> str:
        """How many workers there are, in words."""
        return self.cluster.status()

    def summary(self) -> str:
        """What the cluster did, in a line."""
        done = self.cluster.dispatch
        again = f", {done.again:,} of them once more, for workers that were lost" if done.again else ""
        blocks, workers = sum(done.blocks.values()), len(done.blocks)
        by = f"{workers:,} worker{'' if workers == 1 else 's'}"
        return f"{self.cluster.address}: {blocks:,} block{'' if blocks == 1 else 's'} traced by {by}{again}"

    def __exit__(self, *_: object) -> None:
        try:
            self.cluster.close()
        finally:
            self._remove()

    def _remove(self) -> None:
        if self._file:
            with suppress(OSError):  # the shared folder has gone
                Path(self._file.path).unlink()
        self._file = None
