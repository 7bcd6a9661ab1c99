"""What a cluster on one machine costs beside the plain bake: `python -m benchmarks.cluster [MESH] [--samples 768]`.

The command by itself, with `--cluster local` (one worker on all cores) and with `--cluster local:N` (N workers of one
core each) in turns, whole processes, on a bumpy sphere of 400,000 vertices unless a mesh is given. Medians of wall
time, and the bytes that are sent for each point. Outputs are compared. Take enough rays for half a minute: on two cores
the default does, and all of it takes three to four minutes.
"""

from __future__ import annotations

import argparse
import pickle
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from obscurance.ao.execute.tracer import Hemispheres
from obscurance.ao.falloff import Exponential
from obscurance.ao.points.points import Points
from obscurance.raytrace.system.atomic import write_json
from obscurance.raytrace.system.threads import thread_count
from obscurance.scenes.validation.table import text_table

from .meshes import bumpy_sphere
from .time_against_error.machine import machine

ROUNDS, WARM, VERTICES = 2, 16, 400_000
RESULT = Path(__file__).parent / "results" / "cluster.json"
OBSCURANCE = [sys.executable, str(Path(__file__).parents[1] / "cli.py")]


def measure(mesh: Path, samples: int, rounds: int, folder: Path) -> list[dict[str, Any]]:
    """Wall seconds of each way, medians of rounds in turns."""
    cores = thread_count(None)
    ways = {"plain": [], "local": ["--cluster", "local"], f"local:{cores}": ["--cluster", f"local:{cores}"]}
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for turn in range(rounds + 1):  # the first compiles
        rays = samples if turn else WARM
        for number, (name, options) in enumerate(ways.items()):
            start = time.perf_counter()
            output = folder / f"{number}.npy"
            command = [*OBSCURANCE, "bake", str(mesh), "-o", str(output), "-q", "--samples", str(rays), *options]
            subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
            if turn:
                seconds[name].append(time.perf_counter() - start)
            assert output.read_bytes() == (folder / "0.npy").read_bytes()
    medians = {name: statistics.median(times) for name, times in seconds.items()}
    return [
        {"way": name, "wall": medians[name], "all": times, "ratio": medians[name] / medians["plain"]}
        for name, times in seconds.items()
    ]


def bytes_of_points() -> tuple[float, float]:
    """Bytes that a point's work takes on its way to a worker, and its rows on their way back."""
    count = 1 << 16
    points = Points.lifted(*np.zeros((3, count, 3)))
    mu = Exponential(tau=1.0).resolve(1.0).in_render_space(1.0)
    work = Hemispheres(points, 256, np.uint32(0), count, mu, 1.0, 0)
    return len(pickle.dumps(work)) / count, len(pickle.dumps(work.tables())) / count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh", nargs="?", type=Path, metavar="MESH")
    parser.add_argument("--samples", type=int, default=768)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        mesh = given.mesh
        if mesh is None:
            mesh, sphere = Path(name) / "sphere.stl", bumpy_sphere(VERTICES)
            records = np.zeros(len(sphere.faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
            records["corners"] = sphere.vertices[sphere.faces]
            mesh.write_bytes(bytes(80) + np.uint32(len(records)).tobytes() + records.tobytes())
        rows = measure(mesh, given.samples, given.rounds, Path(name))
    there, back = bytes_of_points()
    cells = [(row["way"], f"{row['wall']:.1f}", f"{row['ratio']:.2f}") for row in rows]
    print("\n".join(text_table(("way", "seconds", "to plain"), cells, ("seconds", "to plain"))))
    print(f"a point: {there:.0f} bytes there, {back:.0f} back")
    write_json(RESULT, {**machine(), "samples": given.samples, "ways": rows, "bytes": {"there": there, "back": back}})


if __name__ == "__main__":
    main()
