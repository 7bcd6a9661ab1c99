"""`bake --dry-run`: what a bake would take and write, from the meshes and a trial of a few points."""

import time
from collections.abc import Sequence
from pathlib import Path

import ao
from raytrace.errors import ObscuranceError, printable
from raytrace.system.checks import available, in_use, size_text
from raytrace.system.threads import thread_count

from .bake import MeshBake, WorkSize
from .console import columns, compiling, note

_RAYS = 1 << 21  # of a trial: half a second


def dry_run(bakes: Sequence[MeshBake], falloff: "ao.Falloff", besides: Sequence[Path] = ()) -> int:
    """Print points, rays, memory and time that checked bakes would take, and what they, and `besides`, would write.

    Returns: the exit status, 1 if a mesh cannot be read.
    """
    works, held = dict[MeshBake, WorkSize](), 0
    for bake in bakes:
        try:
            source = bake.read()
            held = held or in_use() or 0  # before what a bake makes anew
            works[bake] = bake.work(source, falloff)
        except ObscuranceError as fault:
            if len(bakes) == 1:
                raise
            note(str(fault))
    if works:
        with compiling():
            rows = _rows(list(works.values()), bakes[0], held)
        paths = [path for bake in works for path in bake.outputs().values() if path is not None] + [*besides]
        lines = [printable(str(path)) + (" in place of the one there" if path.exists() else "") for path in paths[:8]]
        lines += [f"and {len(paths) - 8:,} more"] if len(paths) > 8 else []
        print(columns([*rows, *(("would write", line) for line in lines)]))
    return 0 if len(works) == len(bakes) else 1


def _rows(works: Sequence[WorkSize], bake: MeshBake, held: int) -> list[tuple[str, str]]:
    """Args: held: bytes that the process has before it bakes."""
    points, unit = sum(work.points for work in works), works[0].unit
    rays = sum(bake.checked().rays_in_all(work.points) for work in works)
    most = "at most " if bake.tolerance is not None or unit == "texels" else ""
    meshes = f"{len(works):,} meshes, " if len(works) > 1 else ""
    free, needed = available(), max(work.bytes for work in works)
    room = "" if free is None else f", {size_text(free)} available"
    return [
        ("would bake", f"{meshes}{most if unit == 'texels' else ''}{points:,} {unit}"),
        ("rays", f"{most or 'about '}{rays:,}, {rays // max(points, 1):,} each"),
        ("memory", f"about {size_text(needed + held)} in all, {size_text(needed)} of it beside the mesh{room}"),
        ("time", _time(works, bake, most)),
    ]


def _time(works: Sequence[WorkSize], bake: MeshBake, most: str) -> str:
    if bake.tolerance is not None:
        return "as long as the tolerance takes, which only the bake finds out"
    largest = max(works, key=lambda work: work.points)
    if not largest.points:
        return "none: there is nothing to bake"
    each = bake.checked().rays_in_all(largest.points) // largest.points
    fixed, of_point = _trial(largest, min(each, _RAYS))
    points, threads = sum(work.points for work in works), thread_count(bake.threads)
    seconds = fixed * points / largest.points + of_point * points / threads
    text = f"{seconds:.2g} s" if seconds < 100 else f"{seconds / 60:.0f} minutes"
    return f"{most or 'about '}{text} on {threads} threads, by a trial; reading and writing besides"


def _trial(work: WorkSize, rays: int) -> tuple[float, float]:
    """Seconds of one core that the mesh takes whatever is baked, and that a point takes."""

    def seconds(count: int) -> tuple[float, int]:
        start = time.process_time()  # the clock of a busy machine says little
        done = work.trial(count)
        return time.process_time() - start, done

    many = max(_RAYS // rays, 16)
    seconds(min(many, 64))  # loads the kernels
    (fixed, few), (longer, count) = seconds(1), seconds(many)
    return fixed, max(longer - fixed, 0.0) / max(count - few, 1)
