"""The help of `obscurance bake` in sections, and the options of an earlier bake, from its report or manifest."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from typer.core import TyperCommand

_OF_FILES = ("output", "debug_image", "up", "mesh_output", "bent_normals", "bent_space", "error_map")
_NOT_TAKEN = (*_OF_FILES, "threads")
_MOST = 1 << 28  # bytes; anything larger is no report
SECTIONS = {
    "What occludes": ("falloff", "tau", "half_distance", "max_distance", "normals", "hidden", "alpha"),
    "Sampling": ("method", "reconstruct", "traversal", "seed", "threads"),
    "What .glb and .ply show": ("colors", "occlusion", "replace_occlusion", "orm"),
    "Textures": (
        *("size", "texel_size", "uv", "mesh_output", "overlap", "bent_normals", "bent_space", "error_map"),
        *("high", "cage", "half"),
    ),
    "More than one machine, or than its memory": ("part", "cluster", "shared", "tiles"),
    "Reports, repeats, other programs": (
        *("report", "debug_image", "up", "from_report", "resume", "dry_run", "progress", "format", "input_format"),
    ),
}
EXAMPLES = """\b
Examples, with the mesh that obscurance demo writes:
  obscurance bake demo/temple.ply -o temple.glb
  obscurance bake demo/temple.ply -o temple.html --falloff binary --tolerance 0.02
  obscurance bake 'demo/*.ply' --output-dir baked --format glb
  obscurance bake demo/temple.ply -o temple.png --uv unwrap --size 2048
"""


class SectionedCommand(TyperCommand):
    """A command whose help lists options by what they are for, those of no section first."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        section = {name: title for title, names in SECTIONS.items() for name in names}
        rows: dict[str, list[tuple[str, str]]] = {title: [] for title in ("Arguments", "Options", *SECTIONS)}
        for parameter in self.get_params(ctx):
            row = parameter.get_help_record(ctx)
            if row is not None:
                general = "Arguments" if parameter.param_type_name == "argument" else "Options"
                rows[section.get(str(parameter.name), general)].append(row)
        for title, found in rows.items():
            with formatter.section(title):
                formatter.write_dl(found)


def saved_options(path: Path) -> dict[str, Any]:
    """Options as the command line has them, those at which the earlier bake differs from a plain one among them.

    What was written and the number of threads are not taken over.

    Raises:
        InputError: not the report of a bake, or with an option that this version has not.
    """
    from ao.report import SCHEMA_VERSION
    from raytrace.errors import InputError, nearest_name
    from raytrace.system.inputs import check_regular

    from .bake import NO_OPTIONS_OF_BAKE
    from .textures.bake import TextureCommand
    from .vertices import BakeCommand

    check_regular(path, "the report of a bake")
    try:
        if path.stat().st_size > _MOST:
            raise ValueError
        report = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        raise InputError(path, "content", "the report of a bake, JSON", "something else") from None
    version = report.get("schema_version", SCHEMA_VERSION) if isinstance(report, dict) else SCHEMA_VERSION
    if version != SCHEMA_VERSION:
        raise InputError(path, "schema_version", f"a report of schema version {SCHEMA_VERSION}", version)
    if not isinstance(report, dict) or not isinstance(report.get("options"), dict) or "settings" in report:
        got = "the report of a rendering" if isinstance(report, dict) and "settings" in report else "something else"
        raise InputError(path, "options", "the report of a bake, or the manifest of a batch", got)
    options = {name: value for name, value in report["options"].items() if value is not None}
    names = {field.name for kind in (BakeCommand, TextureCommand) for field in fields(kind)}
    for name in options:
        if name not in names - NO_OPTIONS_OF_BAKE:
            near = nearest_name(name, names)
            raise InputError(path, f"options.{name}", "options of this version", "one that it has not", near)
    if options.get("occlusion") == _usual_occlusion(report):
        del options["occlusion"]
    if "mesh" in options:
        options["mesh"] = [options["mesh"]]
    return {name: value for name, value in options.items() if name not in _NOT_TAKEN}


def _usual_occlusion(report: Mapping[str, Any]) -> str:
    """The occlusion texture that the earlier output had unless it was asked for another."""
    entries = report.get("inputs") or [{}]
    output = report["options"].get("output") or entries[0].get("output", "")
    return "auto" if str(output).lower().endswith(".glb") and not report["options"].get("colors") else "none"
