"""Charts of reports, as SVG without scripts; colours come from the page's style."""

import html
from collections.abc import Mapping, Sequence
from typing import Any

_WIDTH, _HEIGHT, _FOOT = 360, 130, 18


def number(value: float) -> str:
    """A number as charts and tables show it: three digits, thousands apart."""
    if value == int(value) and abs(value) < 1e15:
        return f"{int(value):,}"
    return f"{value:.3g}"


def histogram(summary: Mapping[str, Any], label: str) -> str:
    """Bars of a histogram as `ao.report` has it, and its quantiles as a table for readers that see none."""
    bins = summary["histogram"]
    counts, most = bins["counts"], max(*bins["counts"], 1)
    step = _WIDTH / len(counts)
    bars = "".join(
        f'<rect x="{x * step:.2f}" y="{_HEIGHT * (1 - count / most):.2f}" width="{step - 1:.2f}"'
        f' height="{_HEIGHT * count / most:.2f}"/>'
        for x, count in enumerate(counts)
        if count
    )
    shown = f"{label} from {number(summary['least'])} to {number(summary['most'])}, mean {number(summary['mean'])}"
    ticks = _ticks(bins["from"], bins["to"])
    return _svg(f'<g class="bars">{bars}</g>{ticks}', shown, _HEIGHT + _FOOT) + f"<figcaption>{shown}</figcaption>"


def shares(parts: Mapping[str, float], label: str, unit: str) -> str:
    """Parts of a whole as rows of bars with their numbers."""
    most = max(*parts.values(), 1e-300) if parts else 1.0
    rows = "".join(
        f"<tr><th>{html.escape(name.replace('_', ' '))}</th><td>{_bar(value / most)}</td>"
        f"<td>{number(value)}{unit}</td></tr>"
        for name, value in parts.items()
    )
    return f'<table class="shares"><caption>{label}</caption>{rows}</table>'


def calibration(groups: Sequence[Mapping[str, float]]) -> str:
    """Measured errors over estimated ones, with their standard errors, and the line on which they agree."""
    top = 1.1 * max(max(group["estimated"], group["high"]) for group in groups)
    side = _HEIGHT + 50

    def place(value: float) -> float:
        return side * value / top

    marks = "".join(
        f'<line x1="{place(g["estimated"]):.1f}" x2="{place(g["estimated"]):.1f}" y1="{side - place(g["low"]):.1f}"'
        f' y2="{side - place(g["high"]):.1f}"/>'
        f'<circle cx="{place(g["estimated"]):.1f}" cy="{side - place(g["measured"]):.1f}" r="3.5"/>'
        for g in groups
    )
    frame = f'<path class="axes" d="M0 0V{side}H{side}"/><line class="same" x1="0" y1="{side}" x2="{side}" y2="0"/>'
    text = f'<text x="{side + 8}" y="{side}">estimated</text><text x="8" y="12">measured, to {number(top)}</text>'
    return _svg(f'{frame}<g class="marks">{marks}</g>{text}', "measured over estimated errors", side + 4)


def _bar(share: float) -> str:
    filled = f'<rect width="{100 * share:.2f}" height="8"/>'
    return f'<svg class="bar" viewBox="0 0 100 8" preserveAspectRatio="none">{filled}</svg>'


def _ticks(low: float, high: float) -> str:
    places = ((0, low, "start"), (_WIDTH / 2, (low + high) / 2, "middle"), (_WIDTH, high, "end"))
    texts = "".join(
        f'<text x="{x}" y="{_HEIGHT + 14}" text-anchor="{anchor}">{number(value)}</text>' for x, value, anchor in places
    )
    return f'<path class="axes" d="M0 {_HEIGHT}H{_WIDTH}"/>{texts}'


def _svg(content: str, label: str, height: float) -> str:
    return f'<svg viewBox="0 -2 {_WIDTH} {height + 2}" role="img" aria-label="{html.escape(label)}">{content}</svg>'
