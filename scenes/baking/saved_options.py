"""The options of an earlier bake, from its report or from the manifest of a batch: `bake --options`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ao.report import SCHEMA_VERSION
from raytrace.errors import InputError, nearest_name
from raytrace.system.inputs import check_regular

from ..commands.bake import NO_OPTIONS_OF_BAKE, BakeCommand
from ..textures.command import TextureCommand

_OF_FILES = ("output", "debug_image", "up", "mesh_output", "bent_normals", "bent_space", "error_map")
_NOT_TAKEN = (*_OF_FILES, "threads")
_MOST = 1 << 28  # bytes; anything larger is no report


def saved_options(path: Path) -> dict[str, Any]:
    """Options as the command line has them, those at which the earlier bake differs from a plain one among them.

    What was written and the number of threads are not taken over.

    Raises:
        InputError: not the report of a bake, or with an option that this version has not.
    """
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
