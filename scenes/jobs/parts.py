"""`obscurance bake --part`, one of several parts of a bake, into a folder; and `obscurance merge`, which takes them."""

import re
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from raytrace.errors import OptionError
from raytrace.system.checks import make_folder

from ..formats.images import is_texture
from .bake import MeshBake
from .console import note
from .options import BAKE, absolute, cage_of, plain

_OF_TEXTURE = "size", "texel_size"


def trace_part(options: dict[str, Any], bake_command: Callable[[Mapping[str, Any]], MeshBake]) -> int:
    """Trace the part `--part` K/N, of a texture if its size is given, and print a summary. Returns: the exit status, 0.

    Raises: as `MeshBake.run`. InputError: the folder has this part of another bake.
    """
    from ao.execute.parts import PartTraced, ShardCheckpoint

    from ..falloffs import table_of

    number, of = part_numbers(options["part"])
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


def merge(folder: Path, options: dict[str, Any], bake_command: Callable[[Mapping[str, Any]], MeshBake]) -> None:
    """Make of the parts in `folder` what the bake would have made. Raises: as `MeshBake.run`, and InputError.

    Args: options: of the output, as `bake` has them; `mesh`, `high`, `occluder`: where files are, None where they were.
    """
    from ao.execute.parts import Merge, read_parts

    parts = read_parts(folder)
    description, output = parts[0].description, options["output"]
    texture = any(description["options"][name] for name in _OF_TEXTURE)
    if texture and output.suffix.lower() == ".glb":
        options["occlusion"] = "texture"
    elif texture != is_texture(output):
        of_texture, of_vertices = (
            "an image or a .glb: the parts are of a texture",
            "a file of vertices, as the parts are",
        )
        raise OptionError("output", of_texture if texture else of_vertices, output)
    for name in ("mesh", "high", "occluder"):
        stored = description.get(name)
        known = [Path(each) for each in stored] if isinstance(stored, list) else stored and Path(stored)
        options[name] = options[name] or known
    bake_command({**description["options"], **options}).replaced(open_checkpoint=lambda _: Merge(parts)).run()
