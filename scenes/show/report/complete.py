"""A report with everything that its readers ask: the verdict, the command to repeat it, and what was read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raytrace.system.atomic import atomic_write, write_json

from .verdict import verdict

if TYPE_CHECKING:
    from .pictures import Picture


def complete(
    kind: str, line: str, report: Mapping[str, Any], inputs: Sequence[Mapping[str, Any]], options: Mapping[str, Any]
) -> dict[str, Any]:
    """The report of a command, ready for JSON and for `scenes.show.report.document.html_report`.

    Args:
        kind: the command, "bake" or "render". line: the command line that repeats it.
        report: of `ao.report`, or like it; with `pages`, of several pages.
        inputs: from `scenes.show.report.file_hashes.hashed`. options: every effective option.
    """
    first = next(iter(report["pages"].values())) if "pages" in report else report
    head = {"schema_version": first["schema_version"], "kind": kind, "verdict": verdict(report)}
    tail = {"command": line, "inputs": list(inputs), "options": dict(options)}
    return {
        **head,
        **{name: value for name, value in report.items() if name not in head},
        **tail,
        "versions": first["versions"],
    }


def write_report(path: Path, report: Mapping[str, Any], pictures: Callable[[], Sequence[Sequence[Picture]]]) -> None:
    """Write a complete report in the format of the ending, .json or .html.

    Args: pictures: makes them, for .html: as `scenes.show.report.document.html_report` takes them.

    Raises: OutputError: the file cannot be written.
    """
    if path.suffix.lower() == ".json":
        write_json(path, report)
        return
    from .document import html_report  # and what renders

    content = html_report(report, pictures())
    with atomic_write(path) as file:
        file.write(content)
