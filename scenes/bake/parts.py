"""`bake --part`: the rays of one of several parts of a plan; and a plan whose rays were all traced in parts."""

import re
import time
from pathlib import Path
from typing import Any

from ao.execute.parts import PartFile, ShardCheckpoint
from raytrace.errors import ConflictError, OptionError
from raytrace.system.atomic import check_writable
from raytrace.system.checks import make_folder

from ..formats.falloffs import table_of
from ..formats.images import is_texture
from .console import note
from .inputs import read_inputs
from .options import BAKE, BakeOptions, absolute, check_stored, plain
from .plan import Plan, plan_bake

_RESULTS = [row for row in BAKE if row.role == "result" and "part" in row.bake_kinds.split()]


def part_numbers(text: str) -> tuple[int, int]:
    """K and N of `--part` K/N. Raises: OptionError: it is not two such numbers."""
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    number, of = map(int, match.groups()) if match else (0, 0)
    if not 1 <= number <= of:
        raise OptionError("part", "K/N, the K-th of N parts, at most 999999, such as 3/16", repr(text))
    return number, of


def stored_plan(plan: Plan) -> dict[str, Any]:
    """A plan as a part keeps it, JSON-ready: its files, from wherever they are seen, and what decides its rays."""
    options = plan.options
    files = {"mesh": plan.mesh, "occluder": options.occluder, "high": options.high}
    values = {row.name: plain(getattr(options, row.name)) for row in _RESULTS}
    values["cage"] = plain(absolute(options.cage))
    for table in table_of(options.falloff):
        values["falloff"] = f"table:{table.absolute()}"
    return {**{name: plain(absolute(path)) for name, path in files.items() if path}, "options": values}


def trace_part(plan: Plan, folder: Path, number: int, of: int) -> str:
    """Trace a part of a plan without an output into a folder; returns a line about it. Raises: as `ao.bake`."""
    start = time.perf_counter()
    make_folder(folder)
    part = ShardCheckpoint(folder, number, of, stored_plan(plan), note)
    check_writable(part.path.with_suffix(""))  # beside the journal, which says itself what is wrong with a file there
    inputs = read_inputs(plan)
    if plan.kind == "vertices":
        from . import vertices
        from .console import warn

        warn(inputs.meshes, inputs.notes, plan.falloff)
        part.trace(lambda: vertices.trace(plan, inputs, part))
    else:
        from . import texture

        layout = texture.Layout.of(plan, inputs)
        layout.warn(plan, inputs)
        if len(layout.pages) > 1:
            sets = f"{len(layout.pages)} texture sets that overlap, but with --overlap mean"
            raise ConflictError("part", "does not go with", sets)
        part.trace(lambda: texture.trace_page(plan, inputs, layout, layout.pages[0], part))
    return f"{part.path}: {part.rays:,} rays traced in {time.perf_counter() - start:.2f} s"


def merged_plan(parts: list[PartFile], mesh: Path | None, options: BakeOptions) -> Plan:
    """The plan of what parts were traced for. Args: mesh, options: of `merge`; files are None where they were.

    Raises: InputError: a part keeps no plan. OptionError: the output is not of the kind of the parts.
    """
    stored = parts[0].description
    values = {row.name: stored["options"].get(row.name, row.default) for row in _RESULTS}
    files = {name: stored[name] for name in ("high", "occluder") if name in stored}
    check_stored(parts[0].path, values | files)
    output = options.output
    of_texture = bool(values["size"] or values["texel_size"])
    if of_texture and output.suffix.lower() == ".glb":
        values["occlusion"] = "texture"
    elif of_texture != is_texture(output):
        expected = "a file of vertices, as the parts are"
        if of_texture:
            expected = "an image or a .glb: the parts are of a texture"
        raise OptionError("output", expected, output)
    for name, paths in files.items():
        values[name] = getattr(options, name) or [Path(path) for path in paths]
    return plan_bake(options.replaced(**values, mesh=[mesh or Path(stored["mesh"])]))._replace(merged=True)
