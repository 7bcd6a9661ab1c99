"""Reports of a bake: the summary of an output, the report, and options taken from an earlier report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from obscurance.ao.declared import Option
from obscurance.raytrace.errors import InputError, nearest_name, shortened

from .options import BAKE, PRESETS, ROWS, check_stored

if TYPE_CHECKING:
    from ..asset.asset import Asset
    from ..show.report.verdict import Pictures
    from .inputs import BakeInputs
    from .plan import Plan

_OF_FALLOFF = "falloff", "tau", "profile"
_MOST = 1 << 28  # bytes; anything larger is no report


class OutputSummary(NamedTuple):
    """The summary of a bake, or of one page of it."""

    text: str  # a line or several
    warnings: list[str]  # which have been printed


class WorkSize(NamedTuple):
    """Points of a bake at most, their unit, and bytes at its peak."""

    points: int
    unit: str
    bytes: int


def hashed_inputs(plan: Plan, inputs: BakeInputs) -> list[dict[str, Any]]:
    """Files that were read, as a report has them."""
    from ..falloffs import table_of
    from ..show.report.verdict import hashed

    return hashed([*inputs.files, *table_of(plan.options.falloff)], {plan.mesh: inputs.content})


def write_bake_report(plan: Plan, report: Mapping[str, Any], inputs: list[dict[str, Any]], pictures: Pictures) -> None:
    """Write the report that a plan asks for. Args: inputs: from `hashed_inputs`. pictures: makes them, for .html."""
    from ..show.report.verdict import write_report

    options = plan.described()
    line = command_line("bake", BAKE, options)
    write_report(plan.options.report, "bake", line, report, inputs, options, pictures)


def command_line(command: str, table: Iterable[Option], options: Mapping[str, Any]) -> str:
    """The line for a shell that runs a command of `obscurance` with options by their names in its report."""
    import shlex

    words = ["obscurance", command]
    for row in table:
        value = options.get(row.name)
        if row.default is ...:
            words += _streamed(str(value), "--input-format")
        elif value is None or row.name == "threads":  # the result is the same
            continue
        elif not isinstance(value, bool):
            for word in value if isinstance(value, list) else [value]:
                words += [row.flags[0], *_streamed(str(word), "--format")]
        elif value is not row.default:
            words.append(row.flags[0].split("/")[not value])
    return shlex.join(words)


def command_again(plan: Plan, source: Asset) -> str:
    """The command that bakes vertices again at another half-distance, "{}", into a file that keeps what it holds."""
    is_painted = source.is_scene or source.materials or source.columns("uv0")
    changed = {name: value for name, value in plan.changed().items() if name not in _OF_FALLOFF}
    target = f"{plan.mesh.stem}-baked{'.glb' if is_painted else '.ply'}"
    line = command_line("bake", BAKE, changed | {"mesh": str(plan.mesh), "output": target, "half_distance": "{}"})
    return line.replace("'{}'", "{}")


def _streamed(name: str, option: str) -> list[str]:
    """A file's name as words of a command; a standard stream, "<stdin>.ply" for instance, becomes "-" with its
    format."""
    stream, _, ending = name.rpartition(".")
    return ["-", option, ending] if stream in ("<stdin>", "<stdout>") else [name]


def saved_options(path: Path) -> dict[str, Any]:
    """Options of an earlier bake, but for what was written and how it was run. Raises: InputError."""
    from json import dumps

    from obscurance.ao.report import SCHEMA_VERSION
    from obscurance.raytrace.system.checks import check_regular

    from ..json_toml import parse_json

    check_regular(path, "the report of a bake")
    try:
        if path.stat().st_size > _MOST:
            raise ValueError
        report = parse_json(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        raise InputError(path, "content", "the report of a bake, JSON", "something else") from None
    report = report if isinstance(report, dict) else {}
    if (version := report.get("schema_version", SCHEMA_VERSION)) != SCHEMA_VERSION:
        raise InputError(path, "schema_version", f"a report of schema version {SCHEMA_VERSION}", version)
    if not isinstance(report.get("options"), dict) or "settings" in report:
        got = "the report of a rendering" if "settings" in report else "something else"
        raise InputError(path, "options", "the report of a bake, or the manifest of a batch", got)
    options = {name: value for name, value in report["options"].items() if value is not None}
    names = {row.name for row in BAKE if row.role != "run"} | {"threads"}
    for name in options.keys() - names:
        near = nearest_name(name, names)
        raise InputError(path, f"options.{name}", "options of this version", "one that it has not", near)
    for name, value in options.items():
        if "\\u0000" in dumps(value):
            raise InputError(path, f"options.{name}", "text without null characters", shortened(repr(value)))
    chosen = PRESETS.get(str(options.get("preset")), {})  # another preset or output may set them otherwise
    options = {name: value for name, value in options.items() if chosen.get(name) != value}
    if options.get("occlusion") == _usual_occlusion(report):
        del options["occlusion"]
    options |= {name: [options[name]] for name in ("mesh", "high") if isinstance(options.get(name), str)}
    check_stored(path, options)
    reused = {name for name in options if ROWS[name].reusable} | ({"up"} if options.get("ground") else set())
    return {name: value for name, value in options.items() if name in reused}


def _usual_occlusion(report: Mapping[str, Any]) -> str:
    """The default of --occlusion for the output of an earlier bake."""
    output = report["options"].get("output")
    if output is None and isinstance(inputs := report.get("inputs"), list):
        output = next((item.get("output") for item in inputs if isinstance(item, dict)), None)
    return "ramp" if str(output).lower().endswith(".glb") and not report["options"].get("colors") else "none"
