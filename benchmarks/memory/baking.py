"""Estimated and measured memory of bakes and pictures, each in a process of its own.

    python -m benchmarks.memory.baking [VERTICES ...]     by default 200000 and 600000

Measured is how far the peak rises above what the process held before, the mesh included: Linux only.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks import RESULTS
from benchmarks.meshes import bumpy_sphere
from obscurance import ao
from obscurance.ao.memory import surface_bytes, vertex_bytes
from obscurance.ao.report import versions
from obscurance.raytrace import Lambert
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.renderer.render import render, rendering_bytes
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings
from obscurance.raytrace.system.atomic import write_json

SAMPLES = 256
FILM = Settings(width=1920, height=1080, samples=1)
CAMERA = Camera((4.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def loose_triangles(vertices: int) -> Mesh:
    """Triangles anywhere, none of which shares a vertex."""
    chance, count = np.random.default_rng(0), vertices // 3
    corners = chance.uniform(-1, 1, (count, 1, 3)) + chance.normal(size=(count, 3, 3)) * 0.5 / np.cbrt(count)
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), source="loose triangles")


def scene_of(mesh: Mesh) -> Scene:
    return Scene((Object(Shape(mesh, Lambert(albedo=0.5))),))


Way = tuple[Callable[[Mesh], object], Callable[[int, int, Mesh], int]]
WAYS: dict[str, Way] = {
    "--samples 256": (lambda mesh: ao.bake(mesh, samples=SAMPLES), lambda n, m, _: vertex_bytes(n, m, SAMPLES, n)),
    "--tolerance .05": (lambda mesh: ao.bake(mesh, tolerance=0.05), lambda n, m, _: vertex_bytes(n, m, 1 << 14, n)),
    "--interior fill": (
        lambda mesh: ao.bake(mesh, samples=SAMPLES, interior="fill"),
        lambda n, m, _: vertex_bytes(n, m, SAMPLES, n),
    ),
    "--method surface": (
        lambda mesh: ao.bake(mesh, samples=SAMPLES, method="surface"),
        lambda n, m, _: surface_bytes(n, m),
    ),
    "render 1920×1080": (
        lambda mesh: render(scene_of(mesh), CAMERA, FILM),
        lambda _n, _m, mesh: rendering_bytes(scene_of(mesh), FILM, True),
    ),
}


def rise(make: Callable[[int], Mesh], vertices: int, way: str) -> dict[str, object]:
    """What one way takes on one mesh, in a forked process that has touched neither Embree nor a thread."""
    receive, send = os.pipe()
    child = os.fork()
    if child == 0:
        mesh = make(vertices)
        Path("/proc/self/clear_refs").write_text("5")
        before = status("VmRSS")
        work, estimate = WAYS[way]
        estimated = estimate(len(mesh.vertices), len(mesh.faces), mesh)
        work(mesh)
        row = {
            "mesh": mesh.source,
            "vertices": len(mesh.vertices),
            "faces": len(mesh.faces),
            "way": way,
            "measured": status("VmHWM") - before,
            "estimated": estimated,
        }
        os.write(send, json.dumps(row).encode())
        os._exit(0)
    os.close(send)
    with os.fdopen(receive) as pipe:
        found: dict[str, object] = json.loads(pipe.read())
    os.waitpid(child, 0)
    return found


def status(field: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) << 10 for line in lines if line.startswith(field + ":"))


def main() -> None:
    sizes = [int(size) for size in sys.argv[1:]] or [200_000, 600_000]
    rows = []
    for way in WAYS:
        rise(bumpy_sphere, 1000, way)  # compiles
        for make in (bumpy_sphere, loose_triangles):
            for size in sizes:
                row = rise(make, size, way)
                rows.append(row)
                measured, estimated = (int(str(row[name])) >> 20 for name in ("measured", "estimated"))
                print(
                    f"{row['mesh']:<16} {row['vertices']:>9,} {row['faces']:>9,}  {way:<17}"
                    f" {measured:>6,} MiB {estimated:>6,} MiB {estimated / measured:>5.2f}",
                    flush=True,
                )
    target = RESULTS / "memory.json"
    write_json(target, {"rows": rows, "versions": versions()})


if __name__ == "__main__":
    main()
