"""`obscurance bake --cluster`: a bake whose rays are traced by the workers of a Dask cluster."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..commands.bake import BakeCommand
from ..commands.console import note
from ..textures.command import TextureCommand, bake_command

if TYPE_CHECKING:
    from ao.cluster.checkpoint import ClusterCheckpoint


@dataclass(frozen=True)
class ClusterCommand:
    """The command: `bake`, traced by the workers at `address`, which see the folder `shared`."""

    bake: BakeCommand | TextureCommand
    address: str
    shared: Path | None

    def run(self) -> None:
        """Bake, write, and print summaries.

        Raises:
            InputError, OutputError, MemoryLimitError, EmbreeError: as the bake.
            OptionError: there is no scheduler at the address.
            ClusterError: the cluster is lost, or none of its workers can be used.
        """
        opened: list[ClusterCheckpoint] = []
        replace(self.bake, open_checkpoint=lambda target: self._open(target, opened)).run()
        if not self.bake.quiet:
            for checkpoint in opened:
                print(checkpoint.summary())

    def _open(self, target: Path, opened: list[ClusterCheckpoint]) -> ClusterCheckpoint:
        from ao.cluster.checkpoint import ClusterCheckpoint

        journal, threads = f"{target}.partial", self.bake.threads
        opened.append(ClusterCheckpoint(journal, self.address, self.bake.resume, note, self.shared, threads))
        return opened[-1]


def cluster_command(address: str, shared: Path | None, options: dict[str, Any]) -> ClusterCommand:
    """The command for `--cluster` and `--shared`.

    Raises: OptionError: Dask is not installed, `address` is none, or an option does not go with it.
    """
    from raytrace.errors import OptionError

    if find_spec("distributed") is None:
        raise OptionError("cluster", "Dask, which pip install 'obscurance[cluster]' installs", "none")
    from ao.cluster.dask_cluster import local_workers

    local_workers(address)
    if shared is not None and not shared.is_dir():
        raise OptionError("shared", "a folder", shared)
    return ClusterCommand(bake_command(options), address, shared)
