"""Log–log plots of error against bake time."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from .analysis import TARGETS, Curves
from .methods import OURS

PLOTS = {"rmse": ("binary", "binary 5%", "exponential", "exponential 5%"), "p99": ("binary",), "largest": ("binary",)}
AXES = {"rmse": "RMSE", "p99": "99th percentile of |error|", "largest": "largest |error|"}
COLUMNS = 3
LEGEND = 0.5  # inches


def plot(results: dict[str, Any], found: Curves, folder: Path) -> None:
    """One picture for each kind of error and falloff, `rmse-binary.png` for instance: a panel for each mesh."""
    names = [method["name"] for method in results["methods"]]
    ours = {method["name"] for method in results["methods"] if method["program"] == OURS}
    colours = dict(zip(names, plt.get_cmap("tab10").colors, strict=False))
    sizes = {mesh["name"]: mesh["vertices"] for mesh in results["meshes"]}
    for kind, falloffs in PLOTS.items():
        for falloff in falloffs:
            meshes = [mesh for mesh in sizes if (mesh, falloff) in found]
            if not meshes:
                continue
            rows = math.ceil(len(meshes) / COLUMNS)
            figure, axes = plt.subplots(rows, COLUMNS, figsize=(4 * COLUMNS, 3.1 * rows), squeeze=False)
            for panel, mesh in zip(axes.flat, meshes, strict=False):
                for name, points in found[mesh, falloff].items():
                    seen = [(p.seconds, getattr(p, kind)) for p in points if getattr(p, kind) > 0]
                    weight = 2.2 if name in ours else 1.1
                    panel.plot(*zip(*seen, strict=True), "o-", ms=3, lw=weight, color=colours[name], label=name)
                panel.set(xscale="log", yscale="log", title=f"{mesh}, {sizes[mesh]:,} vertices")
                panel.title.set_fontsize(9)
                panel.grid(True, which="both", lw=0.3, alpha=0.5)
                if kind == "rmse":
                    for target in TARGETS:
                        panel.axhline(target, color="0.4", lw=0.6, ls="--")
            for panel in axes.flat[len(meshes) :]:
                panel.axis("off")
            for panel in axes[:, 0]:
                panel.set_ylabel(AXES[kind])
            for panel in axes[-1]:
                panel.set_xlabel("seconds, scene build included")
            handles = {
                text: line for panel in axes.flat for line, text in zip(*panel.get_legend_handles_labels(), strict=True)
            }
            figure.legend(handles.values(), handles.keys(), loc="upper center", ncols=4, frameon=False, fontsize=9)
            figure.tight_layout(rect=(0, 0, 1, 1 - LEGEND / figure.get_figheight()))
            figure.savefig(folder / f"{kind}-{falloff.replace(' ', '-').replace('%', '')}.png", dpi=80)
            plt.close(figure)
