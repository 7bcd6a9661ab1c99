"""Which command of more than one machine the options of `obscurance bake` ask for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .part import PartCommand, part_command
from .workers import ClusterCommand, cluster_command


def distributed_command(
    part: str | None, cluster: str | None, shared: Path | None, options: dict[str, Any]
) -> PartCommand | ClusterCommand:
    """The command. Raises: OptionError: options do not go together."""
    from raytrace.errors import OptionError

    if part and cluster:
        raise OptionError("part", "--part or --cluster", "both")
    if cluster:
        return cluster_command(cluster, shared, options)
    if shared:
        raise OptionError("shared", "--cluster with it", "none")
    return part_command(part or "", options)
