"""A thousand small lights beside the ten that matter: how the time of a picture grows with lights out of reach.

    python -m benchmarks.speed.many_lights [--lights 1000] [--rounds 5]

A floor with blocks on it under a layer of point lights of short range, seen from above. The other scene has only the
ten lights that bring most to a typical pixel: the lit pixel that as many lights reach as the median one, nearest to
the picture's centre. Both are rendered in turn, A B A B …, with all layers off; the ratio is that of median times.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import replace
from statistics import median

import numpy as np
import numpy.typing as npt

from benchmarks import RESULTS
from obscurance.ao.report import versions
from obscurance.raytrace import Lambert
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.lights.kernels import incident
from obscurance.raytrace.lights.sources import PointLight
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings
from obscurance.raytrace.system.atomic import write_json
from obscurance.scenes.geometry.builtin_shapes import Box, Plane

KEPT = 10
SIDE, RANGE, BLOCKS = 20.0, 1.2, 64
TARGET = 5.0


def make_scene(lights: int) -> tuple[Scene, Camera]:
    """A square floor, blocks as instances, and `lights` lamps at random places above them."""
    chance = np.random.default_rng(1)
    block = Shape(Box(size=0.5, fineness=0.25).geometry().mesh, Lambert(albedo=(0.7, 0.6, 0.5)))
    floor = Plane(size=(SIDE, SIDE), fineness=SIDE / 32).geometry().mesh
    objects = [Object(Shape(floor, Lambert(albedo=0.6)))]
    for x, y in chance.uniform(-SIDE / 2, SIDE / 2, (BLOCKS, 2)):
        place = np.eye(4)
        place[:3, 3] = x, y, 0.25
        objects.append(Object(block, place))
    positions = np.column_stack([chance.uniform(-SIDE / 2, SIDE / 2, (lights, 2)), chance.uniform(0.6, 0.9, lights)])
    lamps = tuple(PointLight(position=tuple(map(float, p)), intensity=1.0, range=RANGE) for p in positions)
    camera = Camera((0.0, -0.6 * SIDE, SIDE), (0.0, 0.0, 0.0), field_of_view=42.0)
    return Scene(tuple(objects), lamps), camera


def matter_most(scene: Scene, camera: Camera, settings: Settings) -> tuple[tuple[PointLight, ...], float]:
    """The `KEPT` lights that bring most to a typical pixel, and how many lights reach one on average."""
    depth = render(scene, camera, settings).layers["depth"][..., 0].astype(np.float64)
    y, x = np.mgrid[: settings.height, : settings.width]
    film = [(2 * x + 1 - settings.width) / settings.height, 1 - (2 * y + 1) / settings.height]
    points = np.array(camera.position) + camera.directions(*film) * depth[..., None]
    hit = np.isfinite(depth)
    found, at = points[hit], np.column_stack([y[hit], x[hit]])
    packed = [light.pack() for light in scene.lights]
    places = np.array([light.position for light in scene.lights])  # type: ignore[attr-defined]
    reaching = np.array([np.count_nonzero(np.linalg.norm(places - p, axis=1) < RANGE) for p in found])
    typical = np.flatnonzero(reaching == int(np.median(reaching)))
    centre = np.array([settings.height / 2, settings.width / 2])
    chosen: npt.NDArray[np.float64] = found[typical[np.linalg.norm(at[typical] - centre, axis=1).argmin()]]
    brought = [incident(kind, row, tuple(chosen))[2][0] for kind, row in packed]
    nearness = -np.linalg.norm(places - chosen, axis=1)
    order = np.lexsort((nearness, brought))[::-1][:KEPT]
    return tuple(scene.lights[j] for j in order), float(reaching.mean())  # type: ignore[misc]


def measure(scene: Scene, camera: Camera, settings: Settings) -> tuple[float, dict[str, int]]:
    """Seconds of one rendering, and its counts of rays."""
    start = time.perf_counter()
    frame = render(scene, camera, settings, layers=False)
    return time.perf_counter() - start, frame.rays | frame.rays_skipped


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lights", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()

    many, camera = make_scene(options.lights)
    settings = Settings(960, 640, samples=4, obscurance="off")
    kept, reaching = matter_most(many, camera, Settings(96, 64, samples=1, obscurance="off"))
    scenes = {"many": many, "few": replace(many, lights=kept)}
    seconds: dict[str, list[float]] = {name: [] for name in scenes}
    rays = {}
    for turn in range(options.rounds + 1):
        for name, scene in scenes.items():
            taken, rays[name] = measure(scene, camera, settings)
            if turn:
                seconds[name].append(taken)
    ratio = median(seconds["many"]) / median(seconds["few"])
    result = {
        "lights": {"many": options.lights, "few": KEPT, "reaching_a_pixel": reaching},
        "picture": {"width": settings.width, "height": settings.height, "samples": settings.samples},
        "seconds": seconds,
        "rays": rays,
        "ratio": ratio,
        "target": TARGET,
        "load": os.getloadavg()[0],
        "cores": os.cpu_count(),
        "versions": versions(),
    }
    target = RESULTS / "many_lights.json"
    write_json(target, result)
    print(f"{reaching:.1f} of {options.lights} lights reach a pixel")
    for name, times in seconds.items():
        print(f"{name:<5} {median(times):.3f} s  {rays[name]}")
    print(f"ratio {ratio:.2f} (target {TARGET:g}); written to {target}")


if __name__ == "__main__":
    main()
