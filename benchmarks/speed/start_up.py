"""Whole processes from their start to their end, in turns: `python -m benchmarks.speed.start_up [MESH…]`.

For each mesh, by default a ball of 162 vertices and a coarse built-in temple, a bake, one to a page and a rendering.
Beside them the interpreter alone, `import numpy`, Embree's library with it, `import obscurance` and
`obscurance --help`. Medians of wall and processor time, and of the peak of resident memory (VmHWM: Linux only); the
ratios are to NumPy with Embree's library in the same run. `--beside TREE`: also the commands of another source tree
that has a `.venv`.
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
from benchmarks.memory.picture_4k import peak_of
from benchmarks.time_against_error.machine import machine
from obscurance.raytrace.system.atomic import write_json
from obscurance.raytrace.types import Float64s, Int64s
from obscurance.scenes.geometry.builtin_shapes import temple
from obscurance.scenes.geometry.polyhedra import icosphere
from obscurance.scenes.validation.table import text_table

ROUNDS = 5
EMBREE = "obscurance.raytrace.embree"
_FINENESS = 0.6  # 3,906 vertices
RESULT = RESULTS / "start_up.json"


def written(path: Path, vertices: Float64s, faces: Int64s) -> Path:
    """The path of an OBJ file of these, z turned up to y."""
    lines = [f"v {x} {z} {-y}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    path.write_text("\n".join(lines))
    return path


def cost(command: list[str]) -> tuple[float, float, int]:
    """Wall and processor time of a command, and the peak of its memory when it runs once more."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True, cwd=ROOT)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, peak_of(command)[0]


def of_tree(python: str, tree: Path, meshes: list[Path], folder: Path) -> dict[str, list[str]]:
    """The commands of a source tree, by name."""
    obscurance = [python, str(tree / "cli.py")]
    lines = {"--help": ["--help"]}
    for mesh in meshes:
        for target in ("w.ply", "w.html"):
            lines[f"bake {mesh.name} -o {target}"] = ["bake", str(mesh), "-o", str(folder / target), "-q"]
        size = ["--width", "64", "--height", "64"]
        lines[f"render {mesh.name}"] = ["render", str(mesh), "-o", str(folder / "w.png"), *size, "-q"]
    return {name: [*obscurance, *line] for name, line in lines.items()}


def commands(meshes: list[Path], folder: Path, beside: Path | None) -> dict[str, list[str]]:
    """What is measured, by name."""
    imports = {f"import {name}": [sys.executable, "-c", f"import {name}"] for name in ("numpy", EMBREE, "obscurance")}
    other = of_tree(str(beside / ".venv/bin/python"), beside, meshes, folder) if beside else {}
    here = of_tree(sys.executable, ROOT, meshes, folder)
    named = {f"{name}, {beside and beside.name}": command for name, command in other.items()}
    return {"python": [sys.executable, "-c", "pass"], **imports, **here, **named}


def measure(timed: dict[str, list[str]]) -> list[dict[str, Any]]:
    """Medians of every command, in seconds and bytes."""
    for command in timed.values():
        cost(command)
    rounds: dict[str, list[tuple[float, float, int]]] = {name: [] for name in timed}
    for _ in range(ROUNDS):
        for name, command in timed.items():
            rounds[name].append(cost(command))
    rows = []
    for name, costs in rounds.items():
        wall, cpu, peak = (statistics.median(column) for column in zip(*costs, strict=True))
        rows.append({"command": name, "wall": wall, "cpu": cpu, "peak": peak})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("meshes", nargs="*", type=Path, metavar="MESH")
    parser.add_argument("--beside", type=Path, metavar="TREE")
    options = parser.parse_args()
    given = options.meshes
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if not given:
            mesh = temple(_FINENESS)
            given = [
                written(folder / "ball.obj", *icosphere(2)),
                written(folder / "temple.obj", mesh.vertices, mesh.faces),
            ]
        rows = measure(commands(given, folder, options.beside))
    least = next(row["cpu"] for row in rows if row["command"] == f"import {EMBREE}")
    head = "command", "wall", "CPU", "CPU/NumPy and Embree", "peak"
    cells = [
        (r["command"], f"{r['wall']:.2f}", f"{r['cpu']:.2f}", f"{r['cpu'] / least:.2f}", f"{r['peak'] / 1e6:.1f} MB")
        for r in rows
    ]
    print("\n".join(text_table(head, cells, head[1:])))
    if not options.beside:
        write_json(RESULT, {**machine(), "commands": rows})


if __name__ == "__main__":
    main()
