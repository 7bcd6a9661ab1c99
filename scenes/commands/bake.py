"""`obscurance bake` and `merge`: one input, several into a folder, a part, by a cluster, or none of it written."""

from __future__ import annotations

import os.path
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from raytrace.errors import ConflictError, OptionError
from raytrace.system.atomic import is_standard_output, standard_output

from ..bake.console import quietly
from ..bake.inputs import expand, is_pattern, outputs_in
from ..bake.options import BAKE, BakeOptions, Format, check_kind, check_together
from ..bake.plan import OpenCheckpoint, Plan, in_mesh_units, plan_bake, preset_format
from ..bake.run import run, silence_tolerance_warnings
from ..formats.load import PIPED, STANDARD, standard_input

if TYPE_CHECKING:
    from ..bake.batch import Batch
    from ..bake.cluster import Workers


def run_bake(options: BakeOptions) -> int:
    """Run the command. Returns: the exit status."""
    if options.output_dir:
        check_kind(options, "batch")
    elif options.part:
        check_kind(options, "part")
    check_together(options, BAKE)
    if options.input_format and STANDARD not in options.mesh:
        raise ConflictError("input_format", "needs", "- as INPUT")
    with quietly(options.quiet):
        if not options.output_dir:
            return _run_one(options)
        batch = _batch(options)
        if not options.dry_run:
            return batch.run()
        from .dry_run import dry_run

        batch.check_files(keep=False)
        return dry_run(batch.plans, [batch.manifest])


def _run_one(options: BakeOptions) -> int:
    """Run the bake of one input."""
    mesh = options.mesh[0]
    output = options.output
    format_ = options.format
    name = "part" if options.part else "cluster"
    if STANDARD in options.mesh and len(options.mesh) > 1:
        raise ConflictError("mesh", "does not go with", "others where one is -, standard input")
    _check_output(options.mesh, output, folder=bool(options.part))
    if (options.part or options.cluster) and STANDARD in (mesh, output):
        raise ConflictError(name, "does not go with", "-, a standard stream")
    if output == STANDARD:
        if options.resume:
            raise ConflictError("resume", "does not go with", "-o -, standard output")
        output = standard_output(preset_format(options))
    elif format_ is not None:
        raise ConflictError("format", "needs", "--output-dir or -o -")
    if options.part:
        return _trace_part(options)
    read = Path(f"{PIPED}.ply") if mesh == STANDARD else mesh
    plan = plan_bake(options.replaced(mesh=[read], output=output))
    workers = _workers(options)
    plan.check_files()  # before any workers are asked for, and before anything is read from a pipe
    content = None
    if mesh == STANDARD:
        piped, content = standard_input(options.input_format)
        plan = plan.with_options(mesh=[piped])
    if options.dry_run:
        from .dry_run import dry_run

        return dry_run([plan], content=content)
    if workers:
        from ..bake.cluster import cluster_checkpoint

        with workers.session(plan.output) as session:
            _run(plan, open_checkpoint=partial(cluster_checkpoint, session, options.resume))
        if not options.quiet:
            print(session.summary())
    else:
        _run(plan, content)
    return 0


def _run(plan: Plan, content: bytes | None = None, open_checkpoint: OpenCheckpoint | None = None) -> None:
    """Run a plan and print its summary and its remarks."""
    with silence_tolerance_warnings():
        for summary in run(plan, content, open_checkpoint):
            if not plan.options.quiet:
                print(summary.text, file=sys.stderr if is_standard_output(plan.output) else sys.stdout)


def _trace_part(options: BakeOptions) -> int:
    """Trace a part of a bake, `--part`, and print a line. Returns: the exit status."""
    from ..bake.parts import part_numbers, trace_part

    number, of = part_numbers(options.part)
    _check_folder("output", options.output)
    plan = plan_bake(options.replaced(output=None))
    with silence_tolerance_warnings():
        line = trace_part(plan, options.output, number, of)
    if not options.quiet:
        print(line)
    return 0


def run_merge(folder: Path, mesh: Path | None, values: dict[str, Any]) -> int:
    """Merge the parts in `folder`, of a bake or of a batch. Returns: the exit status, 1 if a mesh of a batch failed.

    Args: mesh: the input, None where it was. values: of the options of `merge`.
    """
    from ..bake.manifest import is_batch_of_parts, merge_batch

    options = BakeOptions(mesh=[], **values)
    check_together(options, BAKE)
    if not is_batch_of_parts(folder):
        if options.output is None:
            raise OptionError("output", "a file, for the parts of a bake", "nothing")
        from ao.execute.parts import Merge, read_parts

        from ..bake.parts import merged_plan

        parts = read_parts(folder)
        plan = merged_plan(parts, mesh, options)
        plan.check_files()
        _run(plan, open_checkpoint=lambda _: Merge(parts))
        return 0
    for name, value in {"mesh": mesh, **values}.items():
        if value and name not in ("quiet", "threads"):
            raise ConflictError(name, "does not go with", "parts of a batch, whose outputs are there already")
    manifest = merge_batch(folder)
    done = manifest.count("done")
    failed = manifest.count("failed")
    if not options.quiet:
        lost = f", {failed:,} failed" if failed else ""
        print(f"{manifest.path}: {done:,} of {done + failed:,} meshes baked{lost}")
    return 1 if failed else 0


def _batch(options: BakeOptions) -> Batch:
    """The batch that the options ask for. Raises: OptionError: no inputs, or several that would have one output."""
    folder = options.output_dir
    if STANDARD in options.mesh:
        raise ConflictError("output_dir", "does not go with", "-, standard input")
    _check_folder("output_dir", folder, nearest="--output")
    inputs = expand(options.mesh)
    outputs = outputs_in(folder, inputs, preset_format(options))
    for mesh in inputs:
        in_mesh_units(options, mesh)
    plan = plan_bake(options.replaced(mesh=inputs[:1], output=outputs[0]))
    plans = [plan.with_options(mesh=[mesh], output=output) for mesh, output in zip(inputs, outputs, strict=True)]
    part = None
    if options.part:
        from ..bake.parts import part_numbers

        part = part_numbers(options.part)
    from ..bake.batch import Batch

    return Batch(plans, folder, _workers(options), part)


def _workers(options: BakeOptions) -> Workers | None:
    if not options.cluster:
        return None
    from ..bake.cluster import Workers

    return Workers(options)


def _check_folder(option: str, folder: Path, nearest: str | None = None) -> None:
    """Check that the folder of an option is there, if its name is not an output's. Raises: OptionError."""
    if folder.suffix.lower().removeprefix(".") in get_args(Format) and not os.path.exists(folder):
        raise OptionError(option, "a folder", f"{folder}, the name of a file", nearest=nearest)


def _check_output(inputs: Sequence[Path], output: Path | None, folder: bool) -> None:
    """Check that there is one input, and an output for it.

    Raises: OptionError.

    Args: folder: whether it may be a folder.
    """
    several = None
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
    if os.path.isdir(output) and not folder:
        raise OptionError("output", "a file", f"{output}, a folder", nearest="--output-dir")
    if several:
        raise OptionError("output", f"--output-dir for {several}", output, nearest="--output-dir")
