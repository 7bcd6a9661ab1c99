"""`--cluster`: bakes and pictures whose rays are traced by the workers of a Dask cluster."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from .bake import MeshBake
from .console import note

if TYPE_CHECKING:
    from ao.cluster.session import ClusterSession
    from ao.execute.checkpoint import Checkpoint


@dataclass(frozen=True)
class Workers:
    """Workers at `address`, which see the folder `shared`, or that of the output.

    Raises: OptionError: Dask is not installed, `address` is none, or `shared` no folder.
    """

    address: str
    shared: Path | None
    threads: int | None

    def __post_init__(self) -> None:
        from raytrace.errors import OptionError

        if find_spec("distributed") is None or find_spec("cryptography") is None:
            expected = "Dask and cryptography: pip install dask distributed cryptography"
            raise OptionError("cluster", expected, "not both")
        from ao.cluster.dask_cluster import local_workers

        local_workers(self.address)
        if self.shared is not None and not self.shared.is_dir():
            raise OptionError("shared", "a folder", self.shared)

    def session(self, output: Path) -> ClusterSession:
        from ao.cluster.session import ClusterSession

        shared = output.parent if self.shared is None else self.shared
        return ClusterSession(self.address, shared, output.name, note, self.threads)


def bake_by_workers(bake: MeshBake, workers: Workers) -> int:
    """Bake, write, and print summaries, with rays traced by `workers`. Returns: the exit status, 0.

    Raises: as `MeshBake.run` and `ClusterSession`.
    """
    bake.check()  # before any are asked for
    with workers.session(bake.output) as session:
        bake.replaced(open_checkpoint=partial(cluster_checkpoint, session, bake.resume)).run()
    if not bake.quiet:
        print(session.summary())
    return 0


def cluster_checkpoint(session: ClusterSession, resume: bool, target: Path | None) -> Checkpoint:
    """Lets workers trace what a target needs, and keeps it beside that; nothing without a target."""
    from ao.execute.checkpoint import Checkpoint

    path = None if target is None else f"{target}.partial"
    return Checkpoint(path, resume, note, fill_spans=session.fill_spans, status=session.status)
