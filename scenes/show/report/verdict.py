"""A report with its verdict: whether what was asked for is met, what is suspicious, and what can be done about it."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from obscurance.raytrace.system.atomic import write_bytes, write_json

if TYPE_CHECKING:
    from .pictures import Picture

Facts = Mapping[str, Any]
Pictures = Callable[[], "Sequence[Sequence[Picture]]"]
COARSE = "between the vertices w, the openness, errs by"  # in a warning about a result, which comes first
_LEVELS = "bad", "note", "good"
_NOISY = 0.02  # RMSE of w that shows in a picture
_OPEN, _CLOSED = 0.999, 0.05  # w of a mesh without occlusion, and of one that is inside out
_INSIDE_OUT = "inwards, so the inside is baked"  # in a warning of `inward_warnings`
_MISSED = 2.0  # times its estimate may an error be measured
_CLIPPED = 0.05  # of the pixels, brighter than an 8-bit picture holds

_OF_FLAGS = {
    "unreferenced": ("belong to no face; w, the openness, is 1 there", "They can be removed from the mesh."),
    "degenerate": (
        "belong only to faces without area; w, the openness, is 1 there",
        "Remove such faces, or ignore these vertices.",
    ),
    "opposed": (
        "have faces that point in opposite directions; w, the openness, is the mean over these faces",
        "Split these vertices.",
    ),
    "hidden": ("lie inside solids{}", "Nothing to do if parts are meant to cross; --interior says what they become."),
    "missed": ("lie outside the cage and take the closest point of the fine mesh", "Make --cage larger."),
    "contact": ("touch other faces; w, the openness, is that of one side", "Nothing to do if parts touch."),
    "folded": (
        "have a normal that points behind one of the faces; w, the openness, is the mean over these",
        "Nothing to do if they are few.",
    ),
}
_OF_POINTS = "have no normal; w, the openness, is 1 there"  # their one flag, "degenerate"
ONE_OF = {"faces": "face", "vertices": "vertex", "points": "point"}
_SINGULAR = {"belong": "belongs", "lie": "lies", "have": "has", "are": "is", "touch": "touches"}


class Finding(NamedTuple):
    level: str  # "good", "note" or "bad"
    what: str
    do: str = ""  # what can be done


def verdict(report: Facts) -> dict[str, Any]:
    """Whether nothing is bad, and the findings, bad ones first; of a report of several pages, of each by its name."""
    pages = report.get("pages", {"": report})
    named = ((name, finding) for name, page in pages.items() for finding in _findings(page))
    findings = [finding._replace(what=f"{name}: {finding.what}") if name else finding for name, finding in named]
    findings = sorted(dict.fromkeys(findings), key=lambda finding: _LEVELS.index(finding.level))
    return {
        "good": all(finding.level != "bad" for finding in findings),
        "findings": [finding._asdict() for finding in findings],
    }


def _findings(report: Facts) -> Iterator[Finding]:
    """The findings of a report, of a bake or of a rendering."""
    yield from (Finding("bad", warning) for warning in report["warnings"] if COARSE in warning)
    if "w" in report:
        yield from _error(report)
        w = report["w"]
        if w["least"] >= _OPEN:
            advice = "Convex meshes are so; else compare --max-distance and --half-distance with the mesh."
            yield Finding("bad", "Nothing occludes anything: w is 1 everywhere.", advice)
        elif w["quantiles"]["0.5"] <= _CLOSED and not report["options"].get("thickness"):
            text = f"Half of w is below {_CLOSED}: the mesh may be inside out."
            advice = "obscurance info MESH tells where its faces look inwards; --flip turns them over."
            yield Finding("bad", text, advice)
        if "flagged" in report:
            kind = "faces" if "faces" in report else "vertices"
            words = flags_in_words(report["flagged"], report[kind], report.get("rays_skipped", {}), kind)
            yield from (Finding("note", f"{text}.", _OF_FLAGS[name][1]) for name, text in words.items())
    else:
        yield from _picture(report)
    for warning in report["warnings"]:
        if "is not met" not in warning and COARSE not in warning:
            yield Finding("bad" if _INSIDE_OUT in warning else "note", warning)


def _error(report: Facts) -> Iterator[Finding]:
    """Findings about the error of w, and whether its estimates are right."""
    rmse = report["rmse_estimate"]
    tolerance = report["options"].get("tolerance")
    estimate = f"estimated RMSE of w is {rmse:.2g}"
    if tolerance is None and rmse > _NOISY:
        yield Finding("note", f"The {estimate}: noise may show.", "--tolerance 0.01, or more --samples.")
    elif tolerance is None:
        yield Finding("good", f"The {estimate}.")
    elif rmse <= tolerance:
        yield Finding("good", f"The tolerance of {tolerance:g} is met: the {estimate}.")
    else:
        text = f"The tolerance of {tolerance:g} is not met: the {estimate}."
        yield Finding("bad", text, "Allow more rays with --samples, or a larger --tolerance.")
    calibration = report["error_calibration"]
    for group in calibration["groups"] if calibration else ():
        if group["low"] > _MISSED * group["estimated"]:
            text = f"Where errors of {group['estimated']:.2g} were expected, {group['measured']:.2g} were measured."
            yield Finding("note", text, "Trust the RMSE of the whole more than the errors of single places.")


def flags_in_words(flagged: dict[str, int], count: int, rays_skipped: dict[str, int], at: str) -> dict[str, str]:
    """The treatment of what a bake flagged of its `count` vertices or faces, by flag, in words.

    Args: `flagged`, `rays_skipped`, `at`: see `ao.Bake`.
    """
    hidden = "; w, the openness, is taken from visible neighbours" if rays_skipped.get("hidden") else ""
    words = {}
    for name, some in flagged.items():
        what = _OF_FLAGS[name][0].format(hidden) if at != "points" else _OF_POINTS
        verb, _, remainder = what.partition(" ")
        if some == 1:
            words[name] = f"One {ONE_OF[at]} {_SINGULAR[verb]} {remainder}"
        elif some:
            words[name] = f"{some:,} of {count:,} {at} {what}"
    return words


def _picture(report: Facts) -> Iterator[Finding]:
    """Findings about a rendering."""
    picture = report["picture"]
    clipped = picture["clipped"]
    if not picture["covered"]:
        yield Finding("bad", "Nothing is in view.", "Check the camera, or leave it out to have everything framed.")
    elif picture["brightest"] <= 0:
        yield Finding("bad", "The picture is black.", "Check the lights and the background.")
    elif clipped > _CLIPPED:
        text = f"{clipped:.0%} of the pixels are brighter than an 8-bit picture holds."
        yield Finding("note", text, "Lower the lights' intensities, or write an .exr.")
    else:
        yield Finding("good", "The picture was made.")
    rmse = report["rmse_estimate"]
    if rmse is not None:
        text = f"The estimated RMSE of w at the vertices in view is {rmse:.2g}."
        noisy = rmse > _NOISY
        yield Finding("note" if noisy else "good", text, "More samples in [bake]." if noisy else "")


def write_report(
    path: Path, kind: str, line: str, report: Facts, inputs: Sequence[Facts], options: Facts, pictures: Pictures
) -> None:
    """Write the report of a command in the format of the ending, .json or .html. Raises: OutputError.

    Args:
        kind: the command, "bake" or "render". line: the command line that repeats it.
        report: of `ao.report`, or like it; with `pages`, of several pages.
        inputs: from `hashed`. options: every effective option. pictures: makes them, for .html: of each page.
    """
    main_page = next(iter(report["pages"].values())) if "pages" in report else report
    head = {"schema_version": main_page["schema_version"], "kind": kind, "verdict": verdict(report)}
    body = {name: value for name, value in report.items() if name not in head}
    tail = {"command": line, "inputs": [*inputs], "options": {**options}, "versions": main_page["versions"]}
    whole = head | body | tail
    if path.suffix.lower() == ".json":
        write_json(path, whole)
        return
    from .document import html_report  # and what renders

    write_bytes(path, html_report(whole, pictures()))


def hashed(files: Iterable[Path], contents: Mapping[Path, bytes | None] = {}) -> list[dict[str, Any]]:
    """Name, size in bytes and SHA-256 of files, each once. Args: contents: of inputs that are no files."""
    files_hashed = []
    for path in dict.fromkeys(files):
        content = contents.get(path)
        with path.open("rb") if content is None else io.BytesIO(content) as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            files_hashed.append({"path": str(path), "bytes": file.seek(0, io.SEEK_END), "sha256": digest})
    return files_hashed
