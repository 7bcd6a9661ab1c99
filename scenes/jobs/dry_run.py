"""`bake --dry-run`: what a bake would take and write, from what the meshes count; no ray is traced."""

from collections.abc import Sequence
from pathlib import Path

import ao
from raytrace.errors import ObscuranceError, printable
from raytrace.system.checks import available, check_memory, in_use, size_text
from raytrace.system.threads import thread_count

from .bake import MeshBake, WorkSize
from .console import columns, note

_RAYS_A_SECOND = 4e6  # of a thread, in a scan


def dry_run(bakes: Sequence[MeshBake], falloff: "ao.Falloff", besides: Sequence[Path] = ()) -> int:
    """Print points, rays, memory and time that checked bakes would take, and what they, and `besides`, would write.

    Returns: the exit status of the bakes, as far as it is known: 1 if one of several would fail.
    Raises: ObscuranceError: the only one would be refused.
    """
    works, held = dict[MeshBake, WorkSize](), 0
    faults: list[ObscuranceError] = []
    for bake in bakes:
        try:
            source = bake.read()
            held = held or in_use() or 0  # before what a bake makes anew
            work = bake.work(source, falloff)
            check_memory(bake.mesh, work.bytes, f"to bake {work.points:,} {work.unit}")
            works[bake] = work
        except ObscuranceError as fault:
            faults.append(fault)
            if len(bakes) > 1:
                note(str(fault))
    if works:
        rows = _rows(list(works.values()), bakes[0], held)
        paths = [path for bake in works for path in bake.outputs().values() if path is not None] + [*besides]
        lines = [printable(str(path)) + (" in place of the one there" if path.exists() else "") for path in paths[:8]]
        lines += [f"and {len(paths) - 8:,} more"] if len(paths) > 8 else []
        ends = [("would fail", f"{len(faults):,} of {len(bakes):,} meshes")] if faults else []
        print(columns([*rows, *(("would write", line) for line in lines), *ends]))
    elif len(bakes) == 1:
        raise faults[0]
    return 1 if faults else 0


def _rows(works: Sequence[WorkSize], bake: MeshBake, held: int) -> list[tuple[str, str]]:
    """Args: held: bytes that the process has before it bakes."""
    points, unit = sum(work.points for work in works), works[0].unit
    rays = sum(bake.checked().rays_in_all(work.points) for work in works)
    most = "at most " if bake.tolerance is not None or unit == "texels" else ""
    meshes = f"{len(works):,} meshes, " if len(works) > 1 else ""
    free, needed = available(), max(work.bytes for work in works)
    room = "" if free is None else f", {size_text(free)} available"
    return [
        ("would bake", f"{meshes}at most {points:,} {unit}"),
        ("rays", f"at most {rays:,}, {rays // max(points, 1):,} each"),
        ("memory", f"about {size_text(needed + held)} in all, {size_text(needed)} of it beside the mesh{room}"),
        ("time", _time(works, bake, most)),
    ]


def _time(works: Sequence[WorkSize], bake: MeshBake, most: str) -> str:
    if bake.tolerance is not None:
        return "as long as the tolerance takes, which only the bake finds out"
    rays = sum(bake.checked().rays_in_all(work.points) for work in works)
    if not rays:
        return "none: there is nothing to bake"
    threads = thread_count(bake.threads)
    seconds = rays / (_RAYS_A_SECOND * threads)
    text = f"{seconds:.2g} s" if seconds < 100 else f"{seconds / 60:.0f} minutes"
    each = f"{_RAYS_A_SECOND / 1e6:.0f} million rays a second"
    return f"{most or 'about '}{text}, with {each} on each of {threads} threads; reading and writing besides"
