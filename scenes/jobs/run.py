"""What `obscurance bake` is to do: bake one input, or several into a folder."""

from __future__ import annotations

import os.path
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_args

from raytrace.errors import OptionError
from raytrace.system.atomic import standard_output

from ..formats.image_names import ENDINGS as IMAGES
from ..formats.image_names import is_texture
from ..formats.standard_input import STANDARD, standard_input
from .bake import MeshBake
from .batch import Batch
from .inputs import expand, is_pattern, outputs_in
from .options import Format
from .shards import PartCommand, part_command, part_numbers
from .tiles import TilesCommand, tiles_command
from .vertices import BakeCommand
from .workers import ClusterCommand, Workers

_OF_VERTICES = {"method": "vertex", "colors": False, "debug_image": None}
_LARGE = "part", "cluster", "shared", "tiles"
_ONE_FILE = dict.fromkeys(_LARGE, "one mesh file and --output with it, or --output-dir")
_ONE_FILE["tiles"] = "one mesh file and --output with it"
_FILES = ("report", "debug_image", "mesh_output", "bent_normals", "error_map")  # one for each bake


def run_bake(options: dict[str, Any]) -> int:
    """Run the command. Args: options: as the command line has them. Returns: the exit status.

    Raises:
        InputError, OutputError, MemoryLimitError, EmbreeError: as `MeshBake.run` and `Batch.run`.
    """
    options = dict(options)
    dry = options.pop("dry_run")
    large = {name: options.pop(name) for name in _LARGE}
    if (large["part"] or large["cluster"]) and options["output_dir"] is not None:
        return _large_batch(options, dry, large).run()
    if any(large.values()):
        _for_one_file(options, dry, large)
        _large_command(**large, options=options).run()
        return 0
    chosen = _chosen(options)
    if not dry:
        return chosen.run()
    from .dry_run import dry_run

    if isinstance(chosen, Batch):
        return dry_run(chosen.bakes, chosen.check(keep=False), [chosen.manifest])
    return dry_run([chosen], chosen.check())


def run_merge(folder: Path, options: dict[str, Any]) -> int:
    """Merge the parts in `folder`, of a bake or of a batch. Returns: the exit status, 1 if a mesh of a batch failed.

    Raises:
        InputError, OutputError, MemoryLimitError: as `scenes.jobs.shards.merge` and `merge_batch`.
    """
    from .manifest import is_batch_of_parts, merge_batch
    from .shards import merge

    if not is_batch_of_parts(folder):
        if options["output"] is None:
            raise OptionError("output", "a file, for the parts of a bake", "nothing")
        merge(folder, options, bake_command)
        return 0
    for name, value in options.items():
        if value and name not in ("quiet", "threads"):
            raise OptionError(name, "no such option for parts of a batch, whose outputs are there already", "one")
    manifest = merge_batch(folder)
    done, failed = manifest.count("done"), manifest.count("failed")
    if not options["quiet"]:
        print(
            f"{manifest.path}: {done:,} of {done + failed:,} meshes baked" + (f", {failed:,} failed" if failed else "")
        )
    return 1 if failed else 0


def _large_batch(options: dict[str, Any], dry: bool, large: dict[str, Any]) -> Batch:
    """The batch that a cluster bakes, or a part of one. Raises: OptionError: options do not go together."""
    name = "part" if large["part"] else "cluster"
    if dry:
        raise OptionError("dry_run", f"no such option with --{name}", "one")
    for other in ("cluster", "shared", "tiles") if large["part"] else ("tiles",):
        if large[other]:
            raise OptionError(other, f"no such option with --{name} and --output-dir", "one")
    chosen = _chosen(options)
    assert isinstance(chosen, Batch)
    if large["part"]:
        return replace(chosen, part=part_numbers(large["part"]))
    return replace(chosen, workers=Workers(large["cluster"], large["shared"], options["threads"]))


def _for_one_file(options: dict[str, Any], dry: bool, large: dict[str, Any]) -> None:
    """Leave of `options` those of a bake of one file. Raises: OptionError: others are given."""
    name = next(name for name, value in large.items() if value)
    for other in ("output_dir", "format", "input_format"):
        if options.pop(other) is not None:
            raise OptionError(other, f"no such option with --{name}", "one")
    given, output = options["mesh"], options["output"]
    if dry:
        raise OptionError("dry_run", f"no such option with --{name}", "one")
    if STANDARD in (*given, output) or len(given) > 1 or is_pattern(given[0]) or output is None:
        raise OptionError(name, _ONE_FILE[name], "others")
    options["mesh"] = given[0]


def _chosen(options: dict[str, Any]) -> MeshBake | Batch:
    """The bake, or the batch, that options ask for.

    Raises: InputError: they do not go together; as `standard_input`.
    """
    given, folder, format_ = options.pop("mesh"), options.pop("output_dir"), options.pop("format")
    input_format = options.pop("input_format")
    if STANDARD in given and (len(given) > 1 or folder is not None):
        raise OptionError("mesh", "files for a batch", "-, standard input")
    if input_format is not None and STANDARD not in given:
        raise OptionError("input_format", "- as the input with it", given[0])
    if folder is not None:
        return _batch(options, given, folder, format_ or "ply")
    _check_single(given, options["output"])
    if options["output"] == STANDARD:
        if options["resume"]:
            raise OptionError("resume", "a file as --output with it", "-, standard output")
        options["output"] = standard_output(format_ or "ply")
    elif format_ is not None:
        raise OptionError("format", "--output-dir or -o - with it", options["output"])
    if given[0] != STANDARD:
        return bake_command({**options, "mesh": given[0]})
    bake_command({**options, "mesh": Path("<stdin>.ply")}).check()  # before anything is read from a pipe
    piped, content = standard_input(input_format)
    return replace(bake_command({**options, "mesh": piped}), content=content)


def _batch(options: dict[str, Any], given: list[Path], folder: Path, ending: str) -> Batch:
    """Raises: OptionError: options of single bakes, inputs that are none, or that would have one output."""
    if folder.suffix.lower().removeprefix(".") in get_args(Format) and not os.path.exists(folder):
        raise OptionError("output_dir", "a folder", f"{folder}, the name of a file", nearest="--output")
    if options["output"] is not None:
        raise OptionError("output_dir", "either --output or --output-dir", "both")
    for name in _FILES:
        if options[name] is not None:
            raise OptionError(name, "--output with it, for a single bake", "--output-dir")
    inputs = expand(given)
    pairs = zip(inputs, outputs_in(folder, inputs, ending), strict=True)
    bakes = [bake_command({**options, "mesh": path, "output": output}) for path, output in pairs]
    return Batch(bakes, folder, options["resume"], options["threads"], options["quiet"])


def _check_single(given: list[Path], output: Path | None) -> None:
    """Raises: OptionError: several inputs, or no output."""
    several = "a pattern" if is_pattern(given[0]) else f"{len(given)} inputs" if len(given) > 1 else None
    if output is None:
        meant = None
        if several:
            forgotten = len(given) == 2 and not os.path.exists(given[1])
            meant = f"-o {given[1]}" if forgotten else "--output-dir"
        raise OptionError("output", "a file, or --output-dir for several inputs", "nothing", nearest=meant)
    if os.path.isdir(output):
        raise OptionError("output", "a file", f"{output}, a folder", nearest="--output-dir")
    if several:
        raise OptionError("output", f"--output-dir for {several}", output, nearest="--output-dir")


def bake_command(options: dict[str, Any]) -> MeshBake:
    """The command for an output.

    Raises: OptionError: the output's ending is unknown, or an option is not for this sort of output.
    """
    from raytrace.system.outputs import check_ending

    from ..write_bake import ENDINGS

    output = options["output"]
    check_ending("output", output, *ENDINGS, *IMAGES)
    own = {field.name for field in fields(BakeCommand)}
    into_glb = options["occlusion"] == "texture"
    usual = output.suffix.lower() == ".glb" and not options["colors"] and options["occlusion"] is None
    auto = usual or options["occlusion"] == "auto"
    if (auto or into_glb) and output.suffix.lower() != ".glb" and not (into_glb and is_texture(output)):
        raise OptionError("occlusion", f"a .glb output with {options['occlusion']}", output)
    if auto and options["colors"]:
        raise OptionError("occlusion", "auto or --colors: viewers multiply one with the other", "both")
    if not is_texture(output) and not into_glb:
        for name in options.keys() - own:
            if options[name]:
                raise OptionError(name, "with it an image to write, or --occlusion texture", output)
        given = {name: options[name] for name in options.keys() & own}
        if not auto:
            return BakeCommand(**given)
        from .textures.auto import AutoCommand

        return AutoCommand(**given)
    for name, usual in _OF_VERTICES.items():
        if options[name] != usual:
            raise OptionError(name, "w at vertices, not in a texture, with it", output)
    from .textures.bake import TextureCommand

    own = {field.name for field in fields(TextureCommand)}
    return TextureCommand(**{name: value for name, value in options.items() if name in own})


def _large_command(
    part: str | None, cluster: str | None, shared: Path | None, tiles: str | None, options: dict[str, Any]
) -> PartCommand | ClusterCommand | TilesCommand:
    """The command. Raises: OptionError: options do not go together."""
    if sum(map(bool, (part, cluster, tiles))) > 1:
        raise OptionError("part" if part else "tiles", "one of --part, --cluster and --tiles", "several")
    if cluster:
        return ClusterCommand(bake_command(options), Workers(cluster, shared, options["threads"]))
    if shared:
        raise OptionError("shared", "--cluster with it", "none")
    return tiles_command(tiles, options) if tiles else part_command(part or "", options, bake_command)
