"""A report as one HTML file to read, from the values that its JSON has, and pictures.

No template engine: some twenty fragments, all of whose values are escaped in one function, need none, and importing one
would be the longest part of writing a report.
"""

import base64
import html
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from raytrace.errors import printable

from ..page.document import policy
from .charts import calibration, histogram, number, shares
from .pictures import Picture, heat

Report = Mapping[str, Any]
_STEPS = 32  # of a legend's colours
_LISTED = 10  # vertices of a flag


def html_report(report: Report, pictures: Sequence[Sequence[Picture]]) -> bytes:
    """A page, UTF-8, without scripts.

    Args:
        report: as its JSON has it, from `scenes.show.report.complete`.
        pictures: of each of its `pages`, or of the one it is.
    """
    folder = files(__package__).joinpath("parts")
    style, template = (folder.joinpath(f"report.{ending}").read_text("utf-8") for ending in ("css", "html"))
    title = f"{Path(report['inputs'][0]['path']).name}: {report['kind']}"
    pages = report.get("pages", {"": report})
    parts = [_verdict(report)]
    for (name, page), shown in zip(pages.items(), pictures, strict=True):
        parts += [f"<h2>{_text(name)}</h2>" if name else "", _pictures(shown), _values(page)]
        parts += [_calibration(page), _costs(page), _flags(page)]
    rows = {each["path"]: f"{number(each['bytes'])} bytes, SHA-256 {each['sha256']}" for each in report["inputs"]}
    parts.append(_section("To repeat it", f"<pre>{_text(report['command'])}</pre>{_table(rows)}"))
    for name in ("settings", "options", "versions"):
        given = {key: value for key, value in report.get(name, {}).items() if value is not None}
        cells = {key: value if isinstance(value, str) else json.dumps(value) for key, value in given.items()}
        parts.append(_section(name.capitalize(), _table(cells)) if name in report else "")
    holes = {"policy": policy(style), "title": _text(title), "style": style, "parts": "\n".join(filter(None, parts))}
    return re.sub("@@(.*?)@@", lambda hole: holes[hole[1]], template).encode()


def _verdict(report: Report) -> str:
    facts = report["verdict"]
    rows = "".join(
        f'<li class="{each["level"]}">{_text(each["what"])}'
        + (f"<p>{_text(each['do'])}</p>" if each["do"] else "")
        + "</li>"
        for each in facts["findings"]
    )
    notes = sum(each["level"] == "note" for each in facts["findings"])
    word, mark = (f"Done, with {notes} to note", "note") if notes else ("All is well", "good")
    if not facts["good"]:
        word, mark = "Look at this first", "bad"
    return f'<section class="verdict {mark}"><h2>{word}</h2><ul>{rows}</ul></section>'


def _pictures(pictures: Sequence[Picture]) -> str:
    figures = "".join(
        f'<figure><img alt="{_text(each.title)}" src="data:image/png;base64,{base64.b64encode(each.png).decode()}">'
        f"<figcaption>{_text(each.title)}{'' if each.top is None else _legend(each.top)}</figcaption></figure>"
        for each in pictures
    )
    return _section("Pictures", f'<div class="pictures">{figures}</div>') if pictures else ""


def _legend(top: float) -> str:
    colours = np.rint(255 * heat(np.linspace(0, 1, _STEPS)).astype(np.float64)).astype(np.uint8)
    fills = [f"#{colour.tobytes().hex()}" for colour in colours]
    bar = "".join(f'<rect x="{x}" width="1.1" height="1" fill="{fill}"/>' for x, fill in enumerate(fills))
    crisp = 'shape-rendering="crispEdges" preserveAspectRatio="none"'
    scale = f'<svg class="scale" viewBox="0 0 {_STEPS} 1" {crisp}>{bar}</svg>'
    return f' <span class="legend">0 {scale} {number(top)}</span>'


def _values(report: Report) -> str:
    if "w" not in report:
        return ""
    figures = "".join(f"<figure>{histogram(report[name], name)}</figure>" for name in ("w", "error"))
    what = f"{number(report['vertices'])} vertices" if "vertices" in report else "the covered texels"
    return _section(f"Values at {what}", f'<div class="charts">{figures}</div>')


def _calibration(report: Report) -> str:
    calibrated = report.get("error_calibration")
    if not calibrated:
        return ""
    points, estimated, measured = (number(calibrated[name]) for name in ("points", "estimated", "measured"))
    text = (
        f"{points} points were baked twice: their errors were estimated as {estimated} and measured as {measured}, root"
        " mean squares. This has set the level of all estimates."
    )
    chart = ""
    if calibrated["groups"]:
        text += " Whether they are larger where errors are larger shows below, for groups of points:"
        text += " both agree on the line."
        chart = f'<figure class="calibration">{calibration(calibrated["groups"])}</figure>'
    return _section("Are the errors right?", f"<p>{text}</p>{chart}")


def _costs(report: Report) -> str:
    rays = dict(report["rays"]) if isinstance(report["rays"], Mapping) else {"traced": report["rays"]}
    skipped = {f"not traced: {name}": count for name, count in report["rays_skipped"].items() if count}
    whole = shares(rays | skipped, "Rays", "")
    return _section("Costs", f'<div class="charts">{shares(report["seconds"], "Seconds", " s")}{whole}</div>')


def _flags(report: Report) -> str:
    listed = report.get("flagged_vertices")
    if not listed:
        return ""
    rows = {
        f"{name}: {number(report['flagged'][name])}": ", ".join(map(str, some[:_LISTED]))
        + (", …" if report["flagged"][name] > _LISTED else "")
        for name, some in listed.items()
    }
    text = "The first of each, counted from 0 in the file's order; a report in JSON lists a hundred."
    return _section("Flagged vertices", f"<p>{text}</p>{_table(rows)}")


def _table(rows: Mapping[str, Any]) -> str:
    cells = "".join(f"<tr><th>{_text(name)}</th><td>{_text(value)}</td></tr>" for name, value in rows.items())
    return f"<table>{cells}</table>"


def _section(title: str, content: str) -> str:
    return f"<section><h2>{_text(title)}</h2>{content}</section>"


def _text(value: object) -> str:
    return html.escape(printable(str(value)))
