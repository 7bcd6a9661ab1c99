"""Whole processes from their start to their end, in turns: `python -m benchmarks.speed.start_up [MESH…]`.

For each mesh, by default a coarse built-in temple, a bake. Beside them the interpreter alone, `import numpy`, Embree's
library with it, `import obscurance` and `obscurance --help`. Medians of wall and processor time; the ratios are to
NumPy with Embree's library in the same run.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks import RESULTS, ROOT
from benchmarks.time_against_error.machine import machine
from obscurance.raytrace.system.atomic import write_json
from obscurance.scenes.geometry.builtin_shapes import temple
from obscurance.scenes.validation.table import text_table

ROUNDS = 9
EMBREE = "obscurance.raytrace.embree.library"
_FINENESS = 0.6  # 3,906 vertices
RESULT = RESULTS / "start_up.json"
OBSCURANCE = [sys.executable, str(ROOT / "cli.py")]


def seconds(command: list[str]) -> tuple[float, float]:
    """Wall and processor time of a command."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True, cwd=ROOT)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def commands(meshes: list[Path], folder: Path) -> dict[str, list[str]]:
    """What is timed, by name."""
    imports = {f"import {name}": [sys.executable, "-c", f"import {name}"] for name in ("numpy", EMBREE, "obscurance")}
    bakes = {
        f"bake {mesh.name}": [*OBSCURANCE, "bake", str(mesh), "-o", str(folder / "w.ply"), "-q"] for mesh in meshes
    }
    return {"python": [sys.executable, "-c", "pass"], **imports, "--help": [*OBSCURANCE, "--help"], **bakes}


def measure(meshes: list[Path], folder: Path) -> list[dict[str, Any]]:
    """Medians of every command, in seconds."""
    timed = commands(meshes, folder)
    for command in timed.values():
        seconds(command)
    rounds: dict[str, list[tuple[float, float]]] = {name: [] for name in timed}
    for _ in range(ROUNDS):
        for name, command in timed.items():
            rounds[name].append(seconds(command))
    return [
        {"command": name, "wall": statistics.median(w for w, _ in times), "cpu": statistics.median(c for _, c in times)}
        for name, times in rounds.items()
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", nargs="*", type=Path, metavar="MESH")
    given = parser.parse_args().meshes
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if not given:
            given = [folder / "temple.obj"]
            mesh = temple(_FINENESS)
            lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices] + [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
            given[0].write_text("\n".join(lines))
        rows = measure(given, folder)
    least = next(row["cpu"] for row in rows if row["command"] == f"import {EMBREE}")
    head = "command", "wall", "CPU", "CPU/NumPy and Embree"
    cells = [(r["command"], f"{r['wall']:.2f}", f"{r['cpu']:.2f}", f"{r['cpu'] / least:.2f}") for r in rows]
    print("\n".join(text_table(head, cells, head[1:])))
    write_json(RESULT, {**machine(), "commands": rows})


if __name__ == "__main__":
    main()
