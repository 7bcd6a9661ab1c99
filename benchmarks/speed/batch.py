"""A batch of small meshes against as many commands, and against bakes within one process.

    python -m benchmarks.speed.batch [MESHES [COMMANDS]]     by default 1000, 40 of which also by a command each

Meshes have 500 to 5,000 vertices, half are PLY, half OBJ. Times are from the start of a process to its
end; of the bakes within one process, the time of reading, baking and writing on one thread, shared by the cores.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks import RESULTS, ROOT
from benchmarks.meshes import bumpy_sphere
from obscurance import ao, scenes
from obscurance.ao.report import versions
from obscurance.raytrace.system.atomic import write_json
from obscurance.raytrace.system.threads import thread_count

COMMAND = [sys.executable, "-m", "obscurance", "bake"]


def make_meshes(folder: Path, count: int) -> list[Path]:
    """Meshes of 500 to 5,000 vertices, all different."""
    chance, paths = np.random.default_rng(0), []
    for number, vertices in enumerate(chance.integers(500, 5001, count)):
        mesh = bumpy_sphere(int(vertices))
        points = mesh.vertices * chance.uniform(0.5, 2, 3)
        path = folder / f"mesh{number:04d}.{'ply' if number % 2 else 'obj'}"
        if number % 2:
            rows = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
            rows["count"], rows["corners"] = 3, mesh.faces
            properties = "property float x\nproperty float y\nproperty float z"
            faces = f"element face {len(rows)}\nproperty list uchar int vertex_indices"
            header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{properties}\n{faces}\n"
            path.write_bytes(header.encode() + b"end_header\n" + points.astype("<f4").tobytes() + rows.tobytes())
        else:
            lines = ["v {:.6f} {:.6f} {:.6f}".format(*point) for point in points]
            lines += ["f {} {} {}".format(*face) for face in mesh.faces + 1]
            path.write_text("\n".join(lines) + "\n")
        paths.append(path)
    return paths


def seconds_of(*arguments: object) -> float:
    """From the start of a command to its end."""
    start = time.perf_counter()
    subprocess.run([*COMMAND, *map(str, arguments)], cwd=ROOT, check=True, capture_output=True)
    return time.perf_counter() - start


def in_process(paths: list[Path], target: Path) -> float:
    """Seconds of reading, baking and writing, one mesh after the other, on one thread."""
    start = time.perf_counter()
    for path in paths:
        source = scenes.load(path, target)
        scenes.write(target, ao.bake(source.mesh, threads=1), source)
    return time.perf_counter() - start


def main(count: int = 1000, commands: int = 40) -> None:
    cores = thread_count(None)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = make_meshes(folder, count)
        in_process(paths[:4], folder / "warm.ply")
        single = [seconds_of(path, "-o", folder / "single.ply") for path in paths[:: max(count // commands, 1)]]
        bare = in_process(paths, folder / "bare.ply") / cores
        batch = seconds_of(folder / "mesh*", "--output-dir", folder / "out")
    median = float(np.median(single))
    print(f"{count} meshes, {cores} cores, seconds")
    print(f"a command each, {len(single)} measured: {median:.3f} in the median, {median * count:.1f} for all")
    print(f"bakes within one process, shared by the cores: {bare:.2f}")
    print(
        f"batch: {batch:.2f}, {median * count / batch:.1f} times as fast as commands, {bare / batch:.2f} of in-process"
    )
    figures = {"meshes": count, "cores": cores, "command": single, "in_process": bare, "batch": batch}
    write_json(RESULTS / "batch.json", figures | {"versions": versions()})


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
