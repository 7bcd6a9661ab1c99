"""`bake --dry-run`: rays, memory, time and outputs of a bake, from counts of its meshes; no ray is traced."""

from collections.abc import Sequence
from pathlib import Path

from obscurance.raytrace.errors import ObscuranceError, printable
from obscurance.raytrace.system.checks import available, check_memory, memory_in_use, size_text
from obscurance.raytrace.system.threads import thread_count

from ..bake.console import columns, note
from ..bake.inputs import read_inputs
from ..bake.plan import Plan
from ..bake.report import WorkSize
from ..bake.run import work_size

_RAYS_A_SECOND = 4e6  # of a thread, in a scan


def dry_run(plans: Sequence[Plan], besides: Sequence[Path] = (), content: bytes | None = None) -> int:
    """Print points, rays, memory and time that plans would take, and what they, and `besides`, would write.

    Args: content: of the input of the only plan, if it is no file's.

    Returns: the exit status of the bakes, as far as it is known: 1 if one of several would fail.
    Raises: ObscuranceError: the only one would be refused.
    """
    sizes: list[WorkSize] = []
    paths: list[Path] = []
    faults: list[ObscuranceError] = []
    held = 0
    for plan in plans:
        try:
            inputs = read_inputs(plan, content)
            held = held or memory_in_use() or 0  # before what a bake makes anew
            work = work_size(plan, inputs)
            check_memory(plan.mesh, work.bytes, f"to bake {work.points:,} {work.unit}")
            sizes.append(work)
            paths += plan.outputs.values()
        except ObscuranceError as fault:
            faults.append(fault)
            if len(plans) > 1:
                note(str(fault))
    if sizes:
        paths += besides
        lines = [printable(str(path)) + (" in place of the one there" if path.exists() else "") for path in paths[:8]]
        if len(paths) > 8:
            lines.append(f"and {len(paths) - 8:,} more")
        described = [*_described(sizes, plans[0], held), *(("would write", line) for line in lines)]
        if faults:
            described.append(("would fail", f"{len(faults):,} of {len(plans):,} meshes"))
        print(columns(described))
    elif len(plans) == 1:
        raise faults[0]
    return 1 if faults else 0


def _described(sizes: Sequence[WorkSize], plan: Plan, held: int) -> list[tuple[str, str]]:
    """Lines (name, value) about one plan. Args: held: bytes of memory that the process has before it bakes."""
    points = sum(work.points for work in sizes)
    unit = sizes[0].unit
    rays = sum(plan.arguments.rays_in_all(work.points) for work in sizes)
    meshes = f"{len(sizes):,} meshes, " if len(sizes) > 1 else ""
    free = available()
    needed = max(work.bytes for work in sizes)
    available_text = "" if free is None else f", {size_text(free)} available"
    return [
        ("would bake", f"{meshes}at most {points:,} {unit}"),
        ("rays", f"at most {rays:,}, {rays // max(points, 1):,} each"),
        (
            "memory",
            f"about {size_text(needed + held)} in all, {size_text(needed)} of it beside the mesh{available_text}",
        ),
        ("time", _estimated_time(rays, unit, plan)),
    ]


def _estimated_time(rays: int, unit: str, plan: Plan) -> str:
    """How long the bake of so many rays may take, in words. Args: unit: of the points, as "texels"."""
    if not rays:
        return "none: there is nothing to bake"
    if plan.arguments.tolerance is not None:
        return "as long as the tolerance takes, which only the bake finds out"
    most = "at most" if unit == "texels" else "about"
    threads = thread_count(plan.options.threads)
    seconds = rays / (_RAYS_A_SECOND * threads)
    text = f"{seconds:.2g} s" if seconds < 100 else f"{seconds / 60:.0f} minutes"
    rate = f"{_RAYS_A_SECOND / 1e6:.0f} million rays a second"
    return f"{most} {text}, with {rate} on each of {threads} threads; reading and writing besides"
