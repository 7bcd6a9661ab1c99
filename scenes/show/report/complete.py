"""A report with everything that its readers ask: the verdict, the command to repeat it, and what was read."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raytrace.system.atomic import write_bytes, write_json

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
        inputs: from `hashed`. options: every effective option.
    """
    first = next(iter(report["pages"].values())) if "pages" in report else report
    head = {"schema_version": first["schema_version"], "kind": kind, "verdict": verdict(report)}
    body = {name: value for name, value in report.items() if name not in head}
    tail = {"command": line, "inputs": list(inputs), "options": dict(options), "versions": first["versions"]}
    return head | body | tail


def write_report(path: Path, report: Mapping[str, Any], pictures: Callable[[], Sequence[Sequence[Picture]]]) -> None:
    """Write a complete report in the format of the ending, .json or .html.

    Args: pictures: makes them, for .html: as `scenes.show.report.document.html_report` takes them.

    Raises: OutputError: the file cannot be written.
    """
    if path.suffix.lower() == ".json":
        write_json(path, report)
        return
    from .document import html_report  # and what renders

    write_bytes(path, html_report(report, pictures()))


def hashed(files: Iterable[Path], contents: Mapping[Path, bytes | None] = {}) -> list[dict[str, Any]]:
    """Name, size in bytes and SHA-256 of files, each once. Args: contents: of inputs that are no files."""
    rows = []
    for path in dict.fromkeys(files):
        content = contents.get(path)
        with path.open("rb") if content is None else io.BytesIO(content) as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            rows.append({"path": str(path), "bytes": file.seek(0, io.SEEK_END), "sha256": digest})
    return rows
