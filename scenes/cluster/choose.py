"""Which command for more than one machine, or more than its memory, the options of `obscurance bake` ask for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..tiles.command import TilesCommand, tiles_command
from .part import PartCommand, part_command
from .workers import ClusterCommand, cluster_command


def large_command(
    part: str | None, cluster: str | None, shared: Path | None, tiles: str | None, options: dict[str, Any]
) -> PartCommand | ClusterCommand | TilesCommand:
    """The command. Raises: OptionError: options do not go together."""
    from raytrace.errors import OptionError

    if sum(map(bool, (part, cluster, tiles))) > 1:
        raise OptionError("part" if part else "tiles", "one of --part, --cluster and --tiles", "several")
    if cluster:
        return cluster_command(cluster, shared, options)
    if shared:
        raise OptionError("shared", "--cluster with it", "none")
    return tiles_command(tiles, options) if tiles else part_command(part or "", options)
