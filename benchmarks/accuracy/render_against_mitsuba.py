"""Our renderer beside Mitsuba 3's `direct` integrator: the same picture, and the time it takes.

    python -m benchmarks.accuracy.render_against_mitsuba --peer PEER_PYTHON MESH [MESH …]

PEER_PYTHON is the interpreter of an environment that has mitsuba; its LLVM variants need DRJIT_LIBLLVM_PATH. The
scene is the mesh on a ground plane under four point lights, Lambert, 1920×1080. Agreement: one light at a time,
64 samples, no terminator correction, relative RMSE over the pixels whose neighbourhood is smooth in both pictures.
Time: one sample a pixel, all four lights (Mitsuba: four emitter samples), in turn; both have compiled and built.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from benchmarks import RESULTS
from benchmarks.peers.process import Process
from obscurance.ao.report import versions
from obscurance.raytrace import Lambert, Mesh
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.lights.sources import PointLight
from obscurance.raytrace.mesh.normals import vertex_normals
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings
from obscurance.raytrace.system.atomic import write_json
from obscurance.scenes.formats.load import load
from obscurance.scenes.geometry.primitives import plane

ALBEDO = (0.6, 0.5, 0.4)
WIDTH, HEIGHT, SAMPLES = 1920, 1080, 64


def make_scene(mesh: Mesh) -> tuple[Scene, Camera, list[Mesh], list[PointLight]]:
    """The mesh, y up, on a ground plane, under four lights."""
    r, (x, _, z) = mesh.radius, mesh.centre
    floor = mesh.vertices[:, 1].min()
    ground = plane((x - 4 * r, floor, z - 4 * r), (0, 0, 8 * r), (8 * r, 0, 0), 8 * r).mesh
    meshes = [
        Mesh(m.vertices.astype(np.float32), m.faces, vertex_normals(m.vertices, m.faces).astype(np.float32))
        for m in (mesh, ground)
    ]
    positions = mesh.centre + r * np.array([[2, 3, -2], [-2, 3.5, -1.5], [0.5, 4, 2], [1, 2.5, -3]])
    lights = [PointLight(position=tuple(map(float, p)), intensity=8 * r * r) for p in positions]
    camera = Camera.framing(mesh, (0.3, 0.35, -1), (0, 1, 0), aspect=WIDTH / HEIGHT)
    objects = tuple(Object(Shape(m, Lambert(albedo=ALBEDO, two_sided="viewer"))) for m in meshes)
    return Scene(objects, tuple(lights)), camera, meshes, lights


def export(folder: Path, camera: Camera, meshes: list[Mesh], lights: list[PointLight]) -> Path:
    """The scene as JSON and PLY files for the peer."""
    paths = []
    for number, mesh in enumerate(meshes):
        paths.append(str(folder / f"{number}.ply"))
        made = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_normals=mesh.normals, process=False)
        made.export(paths[-1], vertex_normal=True)
    description = {
        "meshes": paths,
        "albedo": ALBEDO,
        "lights": [{"position": light.position, "intensity": light.intensity} for light in lights],
        "camera": {
            "position": camera.position,
            "target": camera.target,
            "up": camera.up,
            "field_of_view": camera.field_of_view,
        },
        "width": WIDTH,
        "height": HEIGHT,
    }
    target = folder / "scene.json"
    target.write_text(json.dumps(description))
    return target


def smooth(image: npt.NDArray[np.floating], tolerance: float) -> npt.NDArray[np.bool_]:
    """Pixels whose eight neighbours differ from them by at most `tolerance` relative to the picture's mean."""
    grey = image.mean(axis=2)
    calm = np.ones(grey.shape, bool)
    calm[[0, -1]], calm[:, [0, -1]] = False, False
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            calm &= np.abs(np.roll(grey, (dy, dx), (0, 1)) - grey) <= tolerance * grey.mean()
    return calm


def compare(path: Path, python: str, rounds: int) -> dict[str, Any]:
    """Agreement and times on one mesh."""
    scene, camera, meshes, lights = make_scene(load(path).mesh)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        description = export(folder, camera, meshes, lights)
        peer = stack.enter_context(Process(python, "mitsuba_direct.py", description))
        ours = np.zeros((HEIGHT, WIDTH, 3))
        theirs = np.zeros((HEIGHT, WIDTH, 3))
        settings = Settings(width=WIDTH, height=HEIGHT, samples=SAMPLES, terminator=False, obscurance="off")
        for number, light in enumerate(lights):
            peer.ask(samples=SAMPLES, lights=[number], target=str(folder / "peer.npy"))
            theirs += np.load(folder / "peer.npy")[..., :3]
            frame = render(Scene(scene.objects, (light,)), camera, settings, layers=False)
            ours += frame.layers["beauty"][..., :3]
        mask = smooth(ours, 0.05) & smooth(theirs, 0.05) & (theirs.sum(axis=2) > 0)
        difference = (ours - theirs)[mask]
        rmse = float(np.sqrt(np.mean(difference**2)) / np.mean(theirs[mask]))

        once = Settings(width=WIDTH, height=HEIGHT, samples=1, obscurance="off")
        times: dict[str, list[float]] = {"ours": [], "mitsuba": []}
        for turn in range(rounds + 2):
            start = time.perf_counter()
            frame = render(scene, camera, once, layers=False)
            seconds = time.perf_counter() - start
            asked = peer.ask(samples=1, lights=list(range(len(lights))), target=None)["seconds"]
            if turn >= 2:
                times["ours"].append(seconds)
                times["mitsuba"].append(asked)
        ratios = [b / a for a, b in zip(times["ours"], times["mitsuba"], strict=True)]
    return {
        "mesh": path.name,
        "relative_rmse": rmse,
        "compared_pixels": float(mask.mean()),
        "seconds": times,
        "rays": frame.rays,
        "speed_ratio": {"median": median(ratios), "min": min(ratios), "max": max(ratios)},
        "versions": versions() | {"mitsuba": peer.about["version"]},
    }


def describe(row: dict[str, Any]) -> str:
    """A result in one line."""
    seconds = {name: median(values) for name, values in row["seconds"].items()}
    ratio = row["speed_ratio"]
    return (
        f"{row['mesh']}: relative RMSE {row['relative_rmse']:.5f} over {row['compared_pixels']:.0%} of the pixels; "
        f"ours {seconds['ours']:.3f} s, Mitsuba {seconds['mitsuba']:.3f} s, "
        f"{ratio['median']:.2f}× faster ({ratio['min']:.2f}–{ratio['max']:.2f})"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--peer", required=True, help="a Python interpreter that has mitsuba")
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    results = []
    for path in arguments.meshes:
        row = compare(path, arguments.peer, arguments.rounds)
        results.append(row)
        print(describe(row))
    target = RESULTS / "render_against_mitsuba.json"
    target.parent.mkdir(exist_ok=True)
    write_json(target, results)


if __name__ == "__main__":
    main()
