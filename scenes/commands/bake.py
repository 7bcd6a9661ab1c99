"""`obscurance bake`: one input, several into a folder, by a cluster, or none of it written."""

from __future__ import annotations

import os.path
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from obscurance.raytrace.errors import ConflictError, ObscuranceError, OptionError, printable
from obscurance.raytrace.system.atomic import is_standard_output, standard_output
from obscurance.raytrace.system.checks import available_memory, check_memory, memory_in_use, size_text
from obscurance.raytrace.system.threads import thread_count

from ..bake.console import columns, note, quietly
from ..bake.inputs import is_pattern, read_inputs
from ..bake.options import BAKE, BakeOptions, check_kind, check_together
from ..bake.plan import OpenCheckpoint, Plan, plan_bake, preset_format
from ..bake.report import WorkSize
from ..bake.run import kept_by, run, silence_tolerance_warnings, work_size, workers_of
from ..formats.load import PIPED, STANDARD, standard_input

_RAYS_A_SECOND = 4e6  # of a thread, in a scan


def run_bake(options: BakeOptions) -> int:
    """Run the command. Returns: the exit status."""
    if options.output_dir:
        check_kind(options, "batch")
    check_together(options, BAKE)
    if options.input_format and STANDARD not in options.mesh:
        raise ConflictError("input_format", "needs", "- as INPUT")
    with quietly(options.quiet):
        if not options.output_dir:
            return _run_one(options)
        from ..bake.batch import Batch

        batch = Batch.of(options)
        if not options.dry_run:
            return batch.run()
        batch.check_files(keep=False)
        return _dry_run(batch.plans, [batch.manifest])


def _run_one(options: BakeOptions) -> int:
    """Run the bake of one input."""
    mesh = options.mesh[0]
    output = options.output
    format_ = options.format
    if STANDARD in options.mesh and len(options.mesh) > 1:
        raise ConflictError("mesh", "does not go with", "others where one is -, standard input")
    _check_output(options.mesh, output)
    if options.cluster and STANDARD in (mesh, output):
        raise ConflictError("cluster", "does not go with", "-, a standard stream")
    if output == STANDARD:
        output = standard_output(preset_format(options))
    elif format_ is not None:
        raise ConflictError("format", "needs", "--output-dir or -o -")
    options = options.replaced(output=output)
    planned = Path(f"{PIPED}.glb") if mesh == STANDARD else mesh  # of which lengths may have units
    plan = plan_bake(options.replaced(mesh=[planned]))
    plan.check_files()  # before any workers are asked for, and before anything is read from a pipe
    content = None
    if mesh == STANDARD:
        piped, content = standard_input(options.input_format)
        plan = plan_bake(options.replaced(mesh=[piped]), content)
    if options.dry_run:
        return _dry_run([plan], content=content)
    with workers_of(options) as workers:
        _run(plan, content, partial(kept_by, workers))
    if workers and not options.quiet:
        print(workers.summary())
    return 0


def _run(plan: Plan, content: bytes | None, open_checkpoint: OpenCheckpoint) -> None:
    """Run a plan and print its summary and its remarks."""
    with silence_tolerance_warnings():
        for summary in run(plan, content, open_checkpoint):
            if not plan.options.quiet:
                print(summary.text, file=sys.stderr if is_standard_output(plan.output) else sys.stdout)


def _check_output(inputs: Sequence[Path], output: Path | None) -> None:
    """Check that there is one input, and an output for it.

    Raises: OptionError.
    """
    several = None
    for word in inputs[1:]:  # of an option that takes none
        if not word.suffix and not os.path.exists(word):
            raise OptionError("mesh", "mesh files", word)
    if is_pattern(inputs[0]):
        several = "a pattern"
    elif len(inputs) > 1:
        several = f"{len(inputs)} inputs"
    if output is None:
        meant = None
        if several:
            forgotten = len(inputs) == 2 and not os.path.exists(inputs[1])
            meant = f"-o {inputs[1]}" if forgotten else "--output-dir"
        raise OptionError("output", "a file, or --output-dir for several inputs", "nothing", nearest=meant)
    if os.path.isdir(output):
        raise OptionError("output", "a file", f"{output}, a folder", nearest="--output-dir")
    if several:
        raise OptionError("output", f"--output-dir for {several}", output, nearest="--output-dir")


def _dry_run(plans: Sequence[Plan], besides: Sequence[Path] = (), content: bytes | None = None) -> int:
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
    free = available_memory()
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
