"""`obscurance bake`: one input, or several into a folder."""

import os.path
import re
import time
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, get_args

from raytrace.errors import ConflictError, OptionError
from raytrace.system.atomic import standard_output
from raytrace.system.checks import make_folder

from ..falloffs import table_of
from ..formats.images import ENDINGS as IMAGES
from ..formats.images import is_texture
from ..formats.load import STANDARD, standard_input
from ..presets import preset_format, with_preset
from ..write_bake import ENDINGS
from .bake import MeshBake
from .batch import Batch
from .console import note, quietly
from .dry_run import dry_run
from .inputs import expand, is_pattern, outputs_in
from .manifest import is_batch_of_parts, merge_batch
from .options import (
    BAKE,
    SORTS,
    Format,
    absolute,
    cage_of,
    check_sort,
    check_stored,
    check_together,
    defaults,
    plain,
)
from .remote import Workers, cluster_checkpoint
from .vertices import BakeCommand

_OF_TEXTURE = "size", "texel_size"
_MEANT = {".obj": ".ply", ".stl": ".ply", ".gltf": ".glb", ".jpg": ".png", ".jpeg": ".png"}  # which can hold w


def run_bake(options: dict[str, Any]) -> int:
    """Run the command with its options. Returns: the exit status."""
    sort = next((sort for sort, name in SORTS.items() if options[name]), None)
    if sort:
        check_sort(options, sort)
    check_together(options, BAKE)
    if options["input_format"] and STANDARD not in options["mesh"]:
        raise ConflictError("input_format", "needs", "- as INPUT")
    with quietly(options["quiet"]):
        if not options["output_dir"]:
            return _run_single(options)
        batch = _batch(options)
        return dry_run(batch.bakes, batch.check(keep=False), [batch.manifest]) if options["dry_run"] else batch.run()


def run_merge(folder: Path, options: dict[str, Any]) -> int:
    """Merge the parts in `folder`, of a bake or of a batch. Returns: the exit status, 1 if a mesh of a batch failed."""
    check_together(options, BAKE)
    if not is_batch_of_parts(folder):
        if options["output"] is None:
            raise OptionError("output", "a file, for the parts of a bake", "nothing")
        _merge_bake(folder, options)
        return 0
    for name, value in options.items():
        if value and name not in ("quiet", "threads"):
            raise ConflictError(name, "does not go with", "parts of a batch, whose outputs are there already")
    manifest = merge_batch(folder)
    done, failed = manifest.count("done"), manifest.count("failed")
    if not options["quiet"]:
        lost = f", {failed:,} failed" if failed else ""
        print(f"{manifest.path}: {done:,} of {done + failed:,} meshes baked{lost}")
    return 1 if failed else 0


def bake_command(options: Mapping[str, Any]) -> MeshBake:
    """A bake to vertices, or to a texture, as its output asks for. Raises: OptionError."""
    options = {**defaults(), **options}
    output = options["output"]
    ending = output.suffix.lower()
    if ending not in (*ENDINGS, *IMAGES):
        meant = str(output.with_suffix(_MEANT[ending])) if ending in _MEANT else None
        raise OptionError("output", "a name ending in " + ", ".join((*ENDINGS, *IMAGES)), output, nearest=meant)
    options = with_preset(options) | {"cage": cage_of(options["cage"])}
    if options["profile"] is None:
        # where it takes the rays of the bake alone, and has w as baked between its columns
        asked = {"falloff": "exponential", "max_distance": "inf", "method": "vertex", "tolerance": None}
        options["profile"] = ending == ".html" and (asked | {"occluded_by": "all"}).items() <= options.items()
    shown, glb, image = options["occlusion"], ending == ".glb", is_texture(output)
    if shown == "texture" and not (glb or image):
        raise ConflictError(("occlusion", shown), "needs", "a .glb output")
    kind: type[MeshBake] = BakeCommand
    if glb and shown is None and options["thickness"]:
        shown = options["occlusion"] = "none"
    if image or shown == "texture":
        from .textures.bake import TextureCommand as kind
    check_sort(options, kind.sort)
    return kind(options)


def _run_single(options: dict[str, Any]) -> int:
    """Run the bake of one input."""
    given, output, format_ = options["mesh"], options["output"], options["format"]
    large = next((name for name in ("part", "cluster") if options[name]), None)
    if STANDARD in given and len(given) > 1:
        raise ConflictError("mesh", "does not go with", "others where one is -, standard input")
    _check_output(given, output, folder=large == "part")
    if large and STANDARD in (given[0], output):
        raise ConflictError(large, "does not go with", "-, a standard stream")
    if output == STANDARD:
        if options["resume"]:
            raise ConflictError("resume", "does not go with", "-o -, standard output")
        output = standard_output(preset_format(options) or "ply")
    elif format_ is not None:
        raise ConflictError("format", "needs", "--output-dir or -o -")
    options = {**options, "mesh": given[0], "output": output}
    if large == "part":
        return _trace_part(options)
    if large == "cluster":
        workers, bake = Workers(options), bake_command(options)
        bake.check()  # before any workers are asked for
        with workers.session(bake.output) as session:
            bake.replaced(open_checkpoint=partial(cluster_checkpoint, session, bake.resume)).run()
        if not bake.quiet:
            print(session.summary())
        return 0
    if given[0] == STANDARD:
        bake_command({**options, "mesh": Path("<stdin>.ply")}).check()  # before anything is read from a pipe
        options["mesh"], content = standard_input(options["input_format"])
        bake = bake_command(options).replaced(content=content)
    else:
        bake = bake_command(options)
    return dry_run([bake], bake.check()) if options["dry_run"] else bake.run()


def _trace_part(options: dict[str, Any]) -> int:
    """Trace the part `--part` K/N, of a texture if its size is given, and print a summary. Returns: the status."""
    from ao.execute.parts import PartTraced, ShardCheckpoint

    number, of = part_numbers(options["part"])
    _check_folder("output", options["output"])
    folder, texture = options["output"], any(options[name] for name in _OF_TEXTURE)
    stand_in = {"output": folder / ("texture.glb" if texture else "w.npy"), "occlusion": "texture" if texture else None}
    rows = [row for row in BAKE if row.rays and "part" in row.on.split()]
    files = {row.name: plain(absolute(options[row.name])) for row in rows if row.role == "input" and options[row.name]}
    described = {row.name: plain(options[row.name]) for row in rows if row.role == "result"}
    described["profile"] = bool(options["profile"])  # of an .html, too
    described["cage"] = plain(absolute(cage_of(options["cage"])))
    for table in table_of(options["falloff"]):
        described["falloff"] = f"table:{table.absolute()}"
    bake = bake_command(options | stand_in)
    start = time.perf_counter()
    make_folder(folder)
    part = ShardCheckpoint(folder, number, of, {**files, "options": described}, note)
    with suppress(PartTraced):
        bake.replaced(open_checkpoint=lambda _: part).run()
    if not bake.quiet:
        print(f"{part.path}: {part.rays:,} rays traced in {time.perf_counter() - start:.2f} s")
    return 0


def part_numbers(text: str) -> tuple[int, int]:
    """K and N of `--part` K/N. Raises: OptionError: it is not two such numbers."""
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    number, of = map(int, match.groups()) if match else (0, 0)
    if not 1 <= number <= of:
        raise OptionError("part", "K/N, the K-th of N parts, at most 999999, such as 3/16", repr(text))
    return number, of


def _merge_bake(folder: Path, options: dict[str, Any]) -> None:
    """Make of the parts in `folder` what the bake would have made; files are None where they were."""
    from ao.execute.parts import Merge, read_parts

    parts = read_parts(folder)
    description, output = parts[0].description, options["output"]
    rows = [row for row in BAKE if row.role == "result" and "part" in row.on.split()]
    stored = {row.name: description["options"].get(row.name, row.default) for row in rows}
    files = {name: description[name] for name in ("high", "occluder") if name in description}
    check_stored(parts[0].path, stored | files)
    texture = any(stored[name] for name in _OF_TEXTURE)
    if texture and output.suffix.lower() == ".glb":
        options["occlusion"] = "texture"
    elif texture != is_texture(output):
        sort = ("a file of vertices, as the parts are", "an image or a .glb: the parts are of a texture")[texture]
        raise OptionError("output", sort, output)
    options["mesh"] = options["mesh"] or Path(description["mesh"])
    for name, paths in files.items():
        options[name] = options[name] or [Path(path) for path in paths]
    bake_command({**stored, **options}).replaced(open_checkpoint=lambda _: Merge(parts)).run()


def _batch(options: dict[str, Any]) -> Batch:
    """Raises: OptionError: inputs that are none, or that would have one output."""
    given, folder = options["mesh"], options["output_dir"]
    if STANDARD in given:
        raise ConflictError("output_dir", "does not go with", "-, standard input")
    _check_folder("output_dir", folder, nearest="--output")
    inputs = expand(given)
    pairs = zip(inputs, outputs_in(folder, inputs, preset_format(options) or "ply"), strict=True)
    bakes = [bake_command({**options, "mesh": path, "output": output}) for path, output in pairs]
    workers = Workers(options) if options["cluster"] else None
    return Batch(bakes, folder, workers, part_numbers(options["part"]) if options["part"] else None)


def _check_folder(option: str, folder: Path, nearest: str | None = None) -> None:
    """Raises: OptionError: there is none, and its name is that of an output."""
    if folder.suffix.lower().removeprefix(".") in get_args(Format) and not os.path.exists(folder):
        raise OptionError(option, "a folder", f"{folder}, the name of a file", nearest=nearest)


def _check_output(given: list[Path], output: Path | None, folder: bool) -> None:
    """Raises: OptionError: several inputs, or no output. Args: folder: whether that is one."""
    several = "a pattern" if is_pattern(given[0]) else f"{len(given)} inputs" if len(given) > 1 else None
    if output is None:
        meant = None
        if several:
            forgotten = len(given) == 2 and not os.path.exists(given[1])
            meant = f"-o {given[1]}" if forgotten else "--output-dir"
        raise OptionError("output", "a file, or --output-dir for several inputs", "nothing", nearest=meant)
    if os.path.isdir(output) and not folder:
        raise OptionError("output", "a file", f"{output}, a folder", nearest="--output-dir")
    if several:
        raise OptionError("output", f"--output-dir for {several}", output, nearest="--output-dir")
