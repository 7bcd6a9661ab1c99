"""Results as Markdown tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from statistics import median
from typing import Any

from .analysis import TARGETS, Curves, TimeTo, best, geometric_mean, speed_up, time_to
from .methods import OURS
from .suite import MANY

MITSUBA = "best Mitsuba"
MARKS = {"between": "", "beyond": "~", "below": "≤"}
Rows = list[Sequence[str]]


def tables(results: dict[str, Any], found: Curves) -> str:
    """All tables, with where and how they were measured."""
    ours = [method["name"] for method in results["methods"] if method["program"] == OURS]
    parts = [_origin(results)]
    for name in ours:
        parts.append(f"## {name}: how many times as fast\n\n" + _speed_ups(results, found, name))
    parts.append("## Seconds to an RMSE, scene build included\n\n" + _seconds(results, found))
    for name in ours:
        parts.append(
            f"## {name}: limited distance, and the same surface subdivided\n\n" + _growth(results, found, name)
        )
    parts.append("## Scene build\n\n" + _builds(results, found))
    return "\n\n".join(parts) + "\n"


def _origin(results: dict[str, Any]) -> str:
    machine, plan = results["machine"], results["plan"]
    versions = ", ".join(results["versions"].values())
    spread = [max(run["seconds"]) / min(run["seconds"]) - 1 for run in results["runs"] if len(run["seconds"]) > 1]
    lines = [
        "# Time against error",
        "",
        f"Made by `python -m benchmarks.time_against_error`, {results['form']} form, in"
        f" {results['minutes']:.0f} minutes on {machine['cpu']},"
        f" {machine['threads']} threads, load {machine['load']:.1f} before the start, {machine['system']}; {versions}.",
        f"Seeds 0 to {plan['rounds'] - 1}, one a round; reference of {plan['reference_rays']:,} rays at"
        f" {plan['reference_vertices']:,} vertices or all.",
    ]
    if spread:
        lines.append(f"Rounds of the same bake differ by {median(spread):.0%} (median of slowest/fastest − 1).")
    lines += [f"{name} is missing." for name in results["missing"]]
    return "\n".join(lines)


def _rivals(results: dict[str, Any], curve: dict[str, list[Any]], rmse: float) -> dict[str, TimeTo | None]:
    """Times of all methods, and that of the best of Mitsuba's samplers."""
    times = {name: time_to(points, rmse) for name, points in curve.items()}
    mitsuba = [m["name"] for m in results["methods"] if m["program"] == "mitsuba" and m["name"] in times]
    return ({MITSUBA: best(times[name] for name in mitsuba)} if mitsuba else {}) | times


def _speed_ups(results: dict[str, Any], found: Curves, ours: str) -> str:
    dense = {mesh["name"] for mesh in results["meshes"] if mesh["vertices"] >= MANY}
    falloffs = list(dict.fromkeys(falloff for _, falloff in found))
    names = [MITSUBA, *(method["name"] for method in results["methods"] if method["name"] != ours)]
    choices = [(f"{falloff}, all meshes", falloff, None) for falloff in falloffs]
    choices += [("all", None, None), (f"all of {MANY:,} vertices or more", None, dense)]
    rows: Rows = []
    for rmse in TARGETS:
        times = {case: _rivals(results, curve, rmse) for case, curve in found.items()}
        for title, falloff, meshes in choices:
            cases = [c for c in times if falloff in (None, c[1]) and (meshes is None or c[0] in meshes)]
            cells = []
            for name in names:
                known = [(times[c].get(ours), times[c].get(name)) for c in cases]
                cells.append(_mean_cell([(a, b) for a, b in known if a and b]))
            rows.append([f"{rmse:g}", title, *cells])
    note = "Geometric means of seconds theirs / seconds ours at equal RMSE; in brackets how many cases, and how many of"
    note += " them have a time beyond the measured points (~) or a cheapest bake already better than asked (≤)."
    return note + "\n\n" + markdown(["RMSE", "over", *names], rows)


def _mean_cell(pairs: list[tuple[TimeTo, TimeTo]]) -> str:
    mean = geometric_mean(speed_up(a, b) for a, b in pairs)
    if mean is None:
        return "–"
    counts = {how: sum(how in (a.how, b.how) for a, b in pairs) for how in MARKS}
    marks = "".join(f", {counts[how]}{mark}" for how, mark in MARKS.items() if mark and counts[how])
    return f"{mean:.2f} ({len(pairs)}{marks})"


def _seconds(results: dict[str, Any], found: Curves) -> str:
    names = [method["name"] for method in results["methods"]]
    rows: Rows = []
    for (mesh, falloff), curve in found.items():
        for rmse in TARGETS:
            times = _rivals(results, curve, rmse)
            gain = speed_up(times.get(names[0]), times.get(MITSUBA))
            cells = [f"{MARKS[t.how]}{t.seconds:.3g}" if (t := times.get(name)) else "–" for name in names]
            rows.append([mesh, falloff, f"{rmse:g}", *cells, f"{gain:.2f}" if gain else "–"])
    return markdown(["mesh", "falloff", "RMSE", *names, f"{MITSUBA} / {names[0]}"], rows)


def _growth(results: dict[str, Any], found: Curves, ours: str) -> str:
    rows: Rows = []
    for rmse in TARGETS:
        times = {case: time_to(curve.get(ours, []), rmse) for case, curve in found.items()}
        for mesh, falloff in times:
            if falloff.endswith("5%"):
                ratio = speed_up(times[mesh, falloff], times.get((mesh, falloff.split()[0])))
                rows.append([f"{rmse:g}", f"{mesh}: {falloff} / unlimited, times as fast", _number(ratio)])
        for (fine, falloff), coarse in _subdivisions(results, found):
            ratio = speed_up(times[coarse, falloff], times[fine, falloff])
            rows.append([f"{rmse:g}", f"{fine}, {falloff}: times the cost of {coarse}", _number(ratio)])
    limited = [row for row in rows if "unlimited" in row[1]]
    summary = [
        f"Limited to 5 % of the diagonal at RMSE {rmse:g}: {_number(_mean_of(limited, rmse))} times as fast"
        " (geometric mean)."
        for rmse in TARGETS
    ]
    return "\n".join(summary) + "\n\n" + markdown(["RMSE", "what", "ratio"], rows)


def _mean_of(rows: Rows, rmse: float) -> float | None:
    return geometric_mean(float(row[2]) for row in rows if row[0] == f"{rmse:g}" and row[2] != "–")


def _subdivisions(results: dict[str, Any], found: Curves) -> Iterable[tuple[tuple[str, str], str]]:
    """((mesh, falloff), the mesh it is the next subdivision of)."""
    surfaces: dict[str, list[tuple[int, str]]] = {}
    for mesh in results["meshes"]:
        if mesh["surface"]:
            surfaces.setdefault(mesh["surface"], []).append((mesh["vertices"], mesh["name"]))
    for family in surfaces.values():
        ordered = [name for _, name in sorted(family)]
        for coarse, fine in pairwise(ordered):
            yield from (((fine, falloff), coarse) for mesh, falloff in found if mesh == fine)


def _builds(results: dict[str, Any], found: Curves) -> str:
    names = [method["name"] for method in results["methods"]]
    rows: Rows = []
    for mesh in results["meshes"]:
        cells = []
        for name in names:
            points = [p for (of, _), curve in found.items() if of == mesh["name"] for p in curve.get(name, [])]
            cells.append(f"{median(p.build for p in points):.3f}" if points else "–")
        rows.append([mesh["name"], f"{mesh['vertices']:,}", f"{mesh['points']:,}", *cells])
    note = "Seconds, part of the times above. Blender builds its scene within the bake."
    return note + "\n\n" + markdown(["mesh", "vertices", "points", *names], rows)


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def markdown(head: Sequence[str], rows: Rows) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
