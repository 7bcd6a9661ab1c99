"""A checkpoint that lets a cluster trace: its journal is filled by others."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

import numpy as np

from raytrace.types import Bools

from ..trace.checkpoint import AFTER, EVERY, Checkpoint, spans_of
from ..trace.identity import machine
from ..trace.ray_scene import RayScene
from ..trace.work import Advance, Tables, Work
from .dask_cluster import DaskCluster
from .scene_file import SceneFile, write_scene

_FEW = 1 << 19  # rays that are traced here: to send them takes as long


class ClusterCheckpoint(Checkpoint):
    """A checkpoint for `ao.bake` in a `with` block whose rays are traced by the workers of a Dask cluster.

    Args:
        path, resume, tell, after, every: as `Checkpoint`.
        address: `local`, `local:N` or a scheduler's, `tcp://host:port`.
        shared: a folder that all workers see under this name, for the scene; None: that of `path`.
        threads: of all workers on this machine together; None: all cores.

    Attributes:
        cluster: the workers.

    Raises, when the block is entered:
        OptionError: there is no scheduler at the address.
    Raises, in the bake:
        ClusterError: the scheduler is lost, or no worker can be used. What is traced is kept.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        address: str,
        resume: bool = False,
        tell: Callable[[str], object] = print,
        shared: Path | None = None,
        threads: int | None = None,
        after: float = AFTER,
        every: float = EVERY,
    ) -> None:
        super().__init__(path, resume, tell, after, every)
        self.cluster = DaskCluster(address, threads, tell)
        self._shared = self.path.parent if shared is None else shared
        self._scene: SceneFile | None = None

    def __enter__(self) -> ClusterCheckpoint:
        if self.cluster.workers is None:
            self.cluster.connect()
        return self

    def _trace(
        self, work: Work, scene: RayScene, missing: Bools, tables: Tables, threads: int, advance: Advance
    ) -> None:
        if np.count_nonzero(missing) * work.rays < _FEW:
            super()._trace(work, scene, missing, tables, threads, advance)
            return
        if self._scene is None:
            self._scene = write_scene(self._shared, self.path.stem, scene)
            self.cluster.use(self._scene, machine())
        name = work.name
        for first, last, found in self.cluster.trace(work, spans_of(missing)):
            for table, rows in zip(tables, found, strict=True):
                table[first:last] = rows
            self.add(name, tables, first, last)
            self.save()
            advance(last - first)

    def status(self) -> str:
        return self.cluster.status()

    def summary(self) -> str:
        """What the cluster did, in a line."""
        done = self.cluster.dispatch
        again = f", {done.again:,} of them once more, for workers that were lost" if done.again else ""
        count = len(done.blocks)
        workers = f"{count:,} worker{'' if count == 1 else 's'}"
        return f"{self.cluster.address}: {sum(done.blocks.values()):,} blocks traced by {workers}{again}"

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        try:
            super().__exit__(kind, error, _)
        finally:
            self.cluster.close()
            if self._scene:
                Path(self._scene.path).unlink(missing_ok=True)
