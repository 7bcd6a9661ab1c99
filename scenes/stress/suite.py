"""All stress tests, in many poses."""

from __future__ import annotations

from collections.abc import Callable

from .closed_forms import closed_forms
from .contacts import contacts
from .defects import defects
from .limits import limits
from .line import Line
from .pictures import pictures
from .rays import leaks, self_hits
from .topology import topology

GROUPS = (closed_forms, self_hits, leaks, contacts, topology, defects, limits, pictures)


def run_stress(
    long: bool = False, threads: int | None = None, progress: Callable[[int, int], None] | None = None
) -> list[Line]:
    """All lines of the stress table.

    Args:
        long: every pose, minutes; else a few that hold every scale and offset, half a minute.
        threads: as `ao.bake` takes it.
        progress: called with (groups done, groups in all).
    """
    lines: list[Line] = []
    for number, group in enumerate(GROUPS, 1):
        lines += group(long, threads)
        if progress:
            progress(number, len(GROUPS))
    return lines
