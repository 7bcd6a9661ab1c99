"""A report as one HTML file to read, from the values that its JSON has, and pictures.

No template engine: to import one would be the longest part of writing a report.
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

from obscurance.raytrace.errors import printable

from ..page.document import policy
from .pictures import Picture, heat

_WIDTH, _HEIGHT, _FOOT = 360, 130, 18
Report = Mapping[str, Any]
_STEPS = 32  # of a legend's colours
_LISTED = 10  # vertices of a flag


def number(value: float) -> str:
    """A number as charts and tables show it: three digits, thousands apart."""
    if value == int(value) and abs(value) < 1e15:
        return f"{int(value):,}"
    return f"{value:.3g}"


def _histogram(summary: Mapping[str, Any], label: str) -> str:
    """Bars of a histogram as `ao.report` has it, and its quantiles as a table for readers that see none."""
    bins = summary["histogram"]
    counts = bins["counts"]
    most = max(*bins["counts"], 1)
    step = _WIDTH / len(counts)
    bars = "".join(
        f'<rect x="{x * step:.2f}" y="{_HEIGHT * (1 - count / most):.2f}" width="{step - 1:.2f}"'
        f' height="{_HEIGHT * count / most:.2f}"/>'
        for x, count in enumerate(counts)
        if count
    )
    shown = f"{label} from {number(summary['least'])} to {number(summary['most'])}, mean {number(summary['mean'])}"
    low = bins["from"]
    high = bins["to"]
    labels = ((0, low, "start"), (_WIDTH / 2, (low + high) / 2, "middle"), (_WIDTH, high, "end"))
    ticks = f'<path class="axes" d="M0 {_HEIGHT}H{_WIDTH}"/>' + "".join(
        f'<text x="{x}" y="{_HEIGHT + 14}" text-anchor="{anchor}">{number(value)}</text>' for x, value, anchor in labels
    )
    return _svg(f'<g class="bars">{bars}</g>{ticks}', shown, _HEIGHT + _FOOT) + f"<figcaption>{shown}</figcaption>"


def _shares(parts: Mapping[str, float], label: str, unit: str) -> str:
    """Parts of a whole as rows of bars with their numbers."""
    most = max(*parts.values(), 1e-300) if parts else 1.0
    bars = "".join(
        f"<tr><th>{html.escape(name.replace('_', ' '))}</th><td>"
        f'<svg class="bar" viewBox="0 0 100 8" preserveAspectRatio="none">'
        f'<rect width="{100 * (value / most):.2f}" height="8"/></svg></td><td>{number(value)}{unit}</td></tr>'
        for name, value in parts.items()
    )
    return f'<table class="shares"><caption>{label}</caption>{bars}</table>'


def _svg(content: str, label: str, height: float) -> str:
    """An SVG drawing of the charts' width. Args: label: what it shows, for readers that see none."""
    return f'<svg viewBox="0 -2 {_WIDTH} {height + 2}" role="img" aria-label="{html.escape(label)}">{content}</svg>'


def html_report(report: Report, pictures: Sequence[Sequence[Picture]]) -> bytes:
    """A page, UTF-8, without scripts. Args: pictures: of each of the report's `pages`, or of the one it is."""
    folder = files(__package__).joinpath("parts")
    style = folder.joinpath("report.css").read_text("utf-8")
    template = folder.joinpath("report.html").read_text("utf-8")
    title = f"{Path(report['inputs'][0]['path']).name}: {report['kind']}"
    pages = report.get("pages", {"": report})
    parts = [_verdict(report)]
    for (name, page), page_pictures in zip(pages.items(), pictures, strict=True):
        parts += [f"<h2>{_text(name)}</h2>" if name else "", _pictures(page_pictures), _values(page)]
        parts += [_calibration(page), _costs(page), _flags(page)]
    inputs = {file["path"]: f"{number(file['bytes'])} bytes, SHA-256 {file['sha256']}" for file in report["inputs"]}
    parts.append(_section("To repeat it", f"<pre>{_text(report['command'])}</pre>{_table(inputs)}"))
    for name in ("settings", "options", "versions"):
        values = {key: value for key, value in report.get(name, {}).items() if value is not None}
        cells = {key: value if isinstance(value, str) else json.dumps(value) for key, value in values.items()}
        parts.append(_section(name.capitalize(), _table(cells)) if name in report else "")
    holes = {"policy": policy(style), "title": _text(title), "style": style, "parts": "\n".join(filter(None, parts))}
    return re.sub("@@(.*?)@@", lambda hole: holes[hole[1]], template).encode()


def _verdict(report: Report) -> str:
    """The findings as a list, under one word for all."""
    facts = report["verdict"]
    lines = "".join(
        f'<li class="{finding["level"]}">{_text(finding["what"])}'
        + (f"<p>{_text(finding['do'])}</p>" if finding["do"] else "")
        + "</li>"
        for finding in facts["findings"]
    )
    notes = sum(finding["level"] == "note" for finding in facts["findings"])
    word, mark = "All is well", "good"
    if not facts["good"]:
        word, mark = "Look at this first", "bad"
    elif notes:
        word = f"Done, with {notes} to note"
        mark = "note"
    return f'<section class="verdict {mark}"><h2>{word}</h2><ul>{lines}</ul></section>'


def _pictures(pictures: Sequence[Picture]) -> str:
    """The pictures with their titles, and scales of colours."""
    figures = "".join(
        f'<figure><img alt="{_text(picture.title)}"'
        f' src="data:image/png;base64,{base64.b64encode(picture.png).decode()}">'
        f"<figcaption>{_text(picture.title)}{'' if picture.top is None else _legend(picture.top)}</figcaption></figure>"
        for picture in pictures
    )
    return _section("Pictures", f'<div class="pictures">{figures}</div>') if pictures else ""


def _legend(top: float) -> str:
    """A scale of the colours of an error, from 0 to `top`."""
    colours = np.rint(255 * heat(np.linspace(0, 1, _STEPS)).astype(np.float64)).astype(np.uint8)
    fills = [f"#{colour.tobytes().hex()}" for colour in colours]
    bar = "".join(f'<rect x="{x}" width="1.1" height="1" fill="{fill}"/>' for x, fill in enumerate(fills))
    crisp = 'shape-rendering="crispEdges" preserveAspectRatio="none"'
    scale = f'<svg class="scale" viewBox="0 0 {_STEPS} 1" {crisp}>{bar}</svg>'
    return f' <span class="legend">0 {scale} {number(top)}</span>'


def _values(report: Report) -> str:
    """Histograms of w and its error."""
    if "w" not in report:
        return ""
    figures = "".join(f"<figure>{_histogram(report[name], name)}</figure>" for name in ("w", "error"))
    kind = _elements(report)
    what = f"{number(report[kind])} {kind}" if kind else "the covered texels"
    return _section(f"Values at {what}", f'<div class="charts">{figures}</div>')


def _calibration(report: Report) -> str:
    """Measured errors over estimated ones, with their standard errors, and the line on which they agree."""
    calibrated = report.get("error_calibration")
    if not calibrated:
        return ""
    text = (
        f"{number(calibrated['points'])} points were baked twice: their errors were estimated as"
        f" {number(calibrated['estimated'])} and measured as {number(calibrated['measured'])}, root mean squares. This"
        " has set the level of all estimates."
    )
    groups = calibrated["groups"]
    if not groups:
        return _section("Are the errors right?", f"<p>{text}</p>")
    text += (
        " Whether they are larger where errors are larger shows below, for groups of points: both agree on the line."
    )
    # A chart of the groups: error bars of what was measured over what was estimated.
    top = 1.1 * max(max(group["estimated"], group["high"]) for group in groups)
    side = _HEIGHT + 50
    marks = ""
    for group in groups:
        at = {name: side * group[name] / top for name in ("estimated", "measured", "low", "high")}
        x = f"{at['estimated']:.1f}"
        marks += f'<line x1="{x}" x2="{x}" y1="{side - at["low"]:.1f}" y2="{side - at["high"]:.1f}"/>'
        marks += f'<circle cx="{x}" cy="{side - at["measured"]:.1f}" r="3.5"/>'
    frame = f'<path class="axes" d="M0 0V{side}H{side}"/><line class="same" x1="0" y1="{side}" x2="{side}" y2="0"/>'
    words = f'<text x="{side + 8}" y="{side}">estimated</text><text x="8" y="12">measured, to {number(top)}</text>'
    chart = _svg(f'{frame}<g class="marks">{marks}</g>{words}', "measured over estimated errors", side + 4)
    return _section("Are the errors right?", f'<p>{text}</p><figure class="calibration">{chart}</figure>')


def _costs(report: Report) -> str:
    """Charts of the seconds and the rays of a command."""
    rays = dict(report["rays"]) if isinstance(report["rays"], Mapping) else {"traced": report["rays"]}
    skipped = {f"not traced: {name}": count for name, count in report["rays_skipped"].items() if count}
    whole = _shares(rays | skipped, "Rays", "")
    return _section("Costs", f'<div class="charts">{_shares(report["seconds"], "Seconds", " s")}{whole}</div>')


def _elements(report: Report) -> str:
    """What rows of a bake are of, "vertices" or "faces"; nothing of texels or a picture."""
    return next((kind for kind in ("vertices", "faces") if kind in report), "")


def _flags(report: Report) -> str:
    """A table of the first vertices, or faces, that carry each flag."""
    kind = _elements(report)
    listed = report.get(f"flagged_{kind}")
    if not listed:
        return ""
    counts = {
        f"{name}: {number(report['flagged'][name])}": ", ".join(map(str, vertices[:_LISTED]))
        + (", …" if report["flagged"][name] > _LISTED else "")
        for name, vertices in listed.items()
    }
    text = "The first of each, counted from 0 in the file's order; a report in JSON lists a hundred."
    return _section(f"Flagged {kind}", f"<p>{text}</p>{_table(counts)}")


def _table(facts: Mapping[str, Any]) -> str:
    cells = "".join(f"<tr><th>{_text(name)}</th><td>{_text(value)}</td></tr>" for name, value in facts.items())
    return f"<table>{cells}</table>"


def _section(title: str, content: str) -> str:
    return f"<section><h2>{_text(title)}</h2>{content}</section>"


def _text(value: object) -> str:
    return html.escape(printable(str(value)))
