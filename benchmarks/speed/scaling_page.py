"""Tables and a plot of `benchmarks.speed.scaling` for the documentation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

HEAD = """# More cores

Made by `python -m benchmarks.speed.scaling` on {machine}, load {load:.1f} before the start.
benchmarks/evidence/speed.md says what it does. A join costs {joins}.

![How many times as fast on 2 to 32 cores, by the model](scaling.png)

Milliseconds; stages take what the model says for so many cores, the last rows what all take together and how many times
as fast that is as one core. Joins, blocks, the longest block and the time outside blocks are those for the most cores.
"""


def table(name: str, found: dict[str, Any]) -> str:
    """A section of Markdown: the stages of a case, the longest first."""
    model, rows = found["model"], found["stages"]
    one, two = found["seconds"].values()
    whole = {key: sum(row[key] for row in rows.values()) for key in ("joins", "blocks", "outside")}
    whole |= {"longest": max(row["longest"] for row in rows.values()), "model": model}
    last = list(model)[-1]
    lines = [
        f"## {name}",
        "",
        f"Measured: {1e3 * one:.1f} ms on one thread, {1e3 * two:.1f} on two, {one / two:.2f} times as fast.",
        "",
        "| stage | joins | blocks | longest | outside | " + " | ".join(f"{c} cores" for c in model) + " |",
        "|---" * (5 + len(model)) + "|",
    ]
    for stage, row in [*sorted(rows.items(), key=lambda pair: -pair[1]["model"][last]), ("together", whole)]:
        times = [f"{1e3 * t:.2f}" for t in (row["longest"], row["outside"], *row["model"].values())]
        lines.append(f"| {stage} | {row['joins']} | {row['blocks']} | {' | '.join(times)} |")
    gains = [f"{next(iter(model.values())) / t:.2f}" for t in model.values()]
    lines.append(f"| times as fast | | | | | {' | '.join(gains)} |")
    return "\n".join(lines) + "\n"


def write_page(results: dict[str, Any], folder: Path) -> None:
    """`scaling.md` and `scaling.png` of what the benchmark has found."""
    joins = ", ".join(f"{1e6 * cost:.0f} µs on {c} threads" for c, cost in results["joins"].items() if cost)
    machine = results["machine"]
    on = f"{machine['cpu']}, {machine['threads']} threads"
    head = HEAD.format(machine=on, load=machine["load"], joins=joins)
    sections = [head, *(table(name, found) for name, found in results["cases"].items())]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scaling.md").write_text("\n".join(sections), encoding="utf-8")
    _plot(results["cases"], folder / "scaling.png")


def _plot(cases: dict[str, Any], target: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panel = plt.subplots(figsize=(9, 5))
    cores = list(next(iter(cases.values()))["model"])
    panel.plot(cores, cores, color="0.6", lw=0.8, ls="--", label="as many times as cores")
    colours = plt.get_cmap("tab20").colors  # type: ignore[attr-defined]
    for (name, found), colour in zip(cases.items(), colours, strict=False):
        one, *_ = found["model"].values()
        panel.plot(cores, [one / t for t in found["model"].values()], "o-", ms=3, lw=1.3, color=colour, label=name)
    panel.set(xscale="log", yscale="log", xlabel="cores", ylabel="times as fast as one core")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_ticks(cores, [str(c) for c in cores])
        axis.set_ticks([], minor=True)
    panel.grid(True, lw=0.3, alpha=0.5)
    panel.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1, 0.5))
    figure.tight_layout()
    figure.savefig(target, dpi=80)
    plt.close(figure)
