"""What `obscurance bake` is to do: bake one input, or several into a folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from raytrace.errors import OptionError
from raytrace.system.atomic import standard_output

from ..batch.command import Batch
from ..batch.inputs import expand, is_pattern, outputs_in
from ..textures.command import bake_command
from .streams import STANDARD, standard_input

_FILES = ("report", "debug_image", "mesh_output", "bent_normals", "error_map")  # one for each bake


def run_bake(options: dict[str, Any]) -> int:
    """Run the command. Args: options: as the command line has them. Returns: the exit status.

    Raises:
        InputError, OutputError, MemoryLimitError, EmbreeError: as `MeshBake.run` and `Batch.run`.
    """
    options = dict(options)
    given, folder, format_ = options.pop("mesh"), options.pop("output_dir"), options.pop("format")
    input_format = options.pop("input_format")
    if STANDARD in given and (len(given) > 1 or folder is not None):
        raise OptionError("mesh", "files for a batch", "-, standard input")
    if input_format is not None and STANDARD not in given:
        raise OptionError("input_format", "- as the input with it", given[0])
    if options["output"] == STANDARD:
        options["output"], format_ = standard_output(format_ or "ply"), None
    if folder is None:
        _check_single(given, options["output"])
        if format_ is not None:
            raise OptionError("format", "--output-dir or -o - with it", options["output"])
        if given[0] != STANDARD:
            bake_command({**options, "mesh": given[0]}).run()
            return 0
        _check_ahead(options)
        piped, content = standard_input(input_format)
        replace(bake_command({**options, "mesh": piped}), content=content).run()
        return 0
    if options["output"] is not None:
        raise OptionError("output_dir", "either --output or --output-dir", "both")
    for name in _FILES:
        if options[name] is not None:
            raise OptionError(name, "--output with it, for a single bake", "--output-dir")
    inputs = expand(given)
    outputs = outputs_in(folder, inputs, format_ or "ply")
    bakes = [
        bake_command({**options, "mesh": path, "output": output}) for path, output in zip(inputs, outputs, strict=True)
    ]
    return Batch(bakes, Path(folder), options["resume"], options["threads"], options["quiet"]).run()


def _check_ahead(options: dict[str, Any]) -> None:
    """Find mistakes before anything is read from a pipe. Raises: OptionError, OutputError."""
    bake_command({**options, "mesh": Path("<stdin>.ply")}).check()


def _check_single(given: list[Path], output: Path | None) -> None:
    """Raises: OptionError: several inputs, or no output."""
    several = "a pattern" if is_pattern(given[0]) else f"{len(given)} inputs" if len(given) > 1 else None
    if output is None:
        meant = None
        if several:
            forgotten = len(given) == 2 and not given[1].exists()
            meant = f"-o {given[1]}" if forgotten else "--output-dir"
        raise OptionError("output", "a file, or --output-dir for several inputs", "nothing", nearest=meant)
    if several:
        raise OptionError("output", f"--output-dir for {several}", output, nearest="--output-dir")
