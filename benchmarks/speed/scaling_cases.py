"""What `benchmarks.speed.scaling` runs: bakes of generated meshes to vertices and textures, and a picture."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from benchmarks.time_against_error.suite import stone
from obscurance import ao, raytrace
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.geometry.builtin_shapes import temple
from obscurance.scenes.geometry.primitives import plane


def cases() -> dict[str, Callable[[], Callable[[int], object]]]:
    """What there is to run, by name: functions that make one of a number of threads."""
    meshes = {
        "pebble": lambda: stone(3),  # 642 vertices
        "temple": lambda: temple(0.4),  # 6,210
        "stone": lambda: stone(5),  # 10,242
        "large-temple": lambda: temple(0.125),  # 43,982
        "large-stone": lambda: stone(6),  # 40,962
        "huge-stone": lambda: stone(7),  # 163,842
    }
    found: dict[str, Callable[[], Callable[[int], object]]] = {}
    for name, make in meshes.items():
        found[f"{name}-64"] = functools.partial(_vertices, make, samples=64)
        found[f"{name}-.01"] = functools.partial(_vertices, make, tolerance=0.01)
    found["render"] = _rendering
    found["texture-stone"] = functools.partial(_texture, meshes["stone"], 1024)
    found["texture-temple"] = functools.partial(_texture, meshes["temple"], 512)
    return found


def _vertices(make: Callable[[], Mesh], **options: Any) -> Callable[[int], object]:
    mesh = make()
    return lambda threads: ao.bake(mesh, threads=threads, **options)


def _texture(make: Callable[[], Mesh], size: int) -> Callable[[int], object]:
    """64 rays a texel of a square of this size."""
    from obscurance.scenes import unwrap

    mesh = make()
    uv = unwrap(mesh, size)
    return lambda threads: ao.bake_texture(mesh, uv, size, samples=64, threads=threads)


def _rendering() -> Callable[[int], object]:
    """1920×1080 pixels of four samples: a stone on a floor, a sun and three lamps with shadows."""
    meshes = stone(6), plane((-4, -4, -1), (8, 0, 0), (0, 8, 0), 0.1).mesh
    places = ((3.0, -2.0, 3.0), (-3.0, -2.0, 3.0), (0.0, 3.0, 4.0), (0.5, -4.0, 1.0))
    lamps = tuple(raytrace.PointLight(position=place, intensity=10.0) for place in places)
    camera = raytrace.Camera((2.5, -4.0, 2.5), (0.0, 0.0, 0.0), field_of_view=35.0)
    settings = raytrace.Settings(width=1920, height=1080, samples=4)

    def rendered(threads: int) -> object:  # of new shapes, whose geometry has not been kept
        objects = tuple(raytrace.Object(raytrace.Shape(mesh, raytrace.Lambert(albedo=0.6))) for mesh in meshes)
        return raytrace.render(raytrace.Scene(objects, lamps), camera, settings, layers=False, threads=threads)

    return rendered
