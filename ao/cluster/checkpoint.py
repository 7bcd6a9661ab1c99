"""Checkpoints of bakes whose rays are traced by a cluster: a journal that others fill, or none."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from raytrace.types import Bools

from ..execute.checkpoint import Checkpoint
from ..execute.work import Advance, Tables, Work
from ..rays.ray_scene import RayScene
from .session import ClusterSession


class ClusterCheckpoint(Checkpoint):
    """A checkpoint for `ao.bake` in a `with` block whose rays are traced by the workers of a Dask cluster.

    Args:
        path, resume, notify, after, every: as `Checkpoint`. session: the workers, open.

    Raises, in the bake:
        ClusterError: the scheduler is lost, or no worker can be used. What is traced is kept.
    """

    def __init__(
        self, path: str | os.PathLike[str] | None, session: ClusterSession, *settings: Any, **named: Any
    ) -> None:
        super().__init__(path, *settings, **named)
        self.session = session

    def _trace(
        self, work: Work, scene: RayScene, missing: Bools, tables: Tables, threads: int, advance: Advance
    ) -> None:
        if not self.session.worth(work, int(np.count_nonzero(missing))):
            super()._trace(work, scene, missing, tables, threads, advance)
            return
        name = work.name
        for first, last, found in self.session.trace(work, scene, missing):
            for table, rows in zip(tables, found, strict=True):
                table[first:last] = rows
            self.add(name, tables, first, last)
            self.save()
            advance(last - first)

    def status(self) -> str:
        return self.session.status()
