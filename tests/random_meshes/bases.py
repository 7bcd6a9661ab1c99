"""Meshes to be damaged: the built-in shapes and scenes, refined and displaced."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from meshes import raw_mesh

from obscurance.scenes.description.read import read_scene
from obscurance.scenes.geometry.builtin_shapes import menger, temple
from obscurance.scenes.geometry.polyhedra import RawMesh, join
from obscurance.scenes.library import BUILTIN, write_builtin

from .dense import Make, Rng, displacement, refined, sized, unit, used
from .pieces import knot, plane, solid

Base = Callable[[Rng], Make]


def shape(rng: Rng) -> Make:
    """A smooth or boxy solid, or three of them through one another."""
    return _several([solid(rng, 1.0) for _ in range(rng.choice([1, 1, 3]))])


def _several(makes: list[Make]) -> Make:
    return lambda h: join([make(h) for make in makes])


def open_plane(rng: Rng) -> Make:
    """A plane, to be bent."""
    a, b = rng.uniform(0.4, 1.0, 2)
    return lambda h: plane(a, b, h)


def colonnade(rng: Rng) -> Make:
    """The temple."""
    return lambda h: unit(raw_mesh(temple(8 * h)))


def sponge(rng: Rng) -> Make:
    """A Menger sponge of level 1 or 2, its vertices shared or each side's own."""
    level = int(rng.integers(1, 3))
    return lambda h: raw_mesh(menger(level, 1.0, max(round(3.0**-level / h), 1)))


def winding(rng: Rng) -> Make:
    """A winding pipe."""
    return knot(rng, rng.uniform(0.02, 0.12))


def built_in(rng: Rng) -> Make:
    """A built-in scene, all its objects in one, or a piece about one of its faces; the finer the smaller, too."""
    vertices, faces = _scene(str(rng.choice(sorted(BUILTIN))))
    middle = vertices[faces].mean(axis=1)
    near = faces[np.argsort(np.linalg.norm(middle - middle[rng.integers(len(middle))], axis=1))]

    def piece(h: float) -> RawMesh:
        return refined(used((vertices, near[: int(1 / h**2)])), 20 * h)

    return piece


@cache
def _scene(name: str) -> RawMesh:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        write_builtin(name, path)
        objects = read_scene(path).scene.objects
    parts = [
        (np.array(o.shape.mesh.vertices) @ o.transform[:3, :3].T + o.transform[:3, 3], o.shape.mesh.faces)
        for o in objects
    ]
    return unit(join(parts))


BASES: tuple[Base, ...] = (shape, open_plane, colonnade, sponge, winding, built_in)


def dense_base(rng: Rng) -> Callable[[int], RawMesh]:
    """A base of any number of vertices, displaced smoothly or not at all."""
    make = BASES[rng.integers(len(BASES))](rng)
    bend = displacement(rng, rng.choice([0.0, 1.0]) * rng.uniform(0.1, 1.0))

    def dense(size: int) -> RawMesh:
        vertices, faces = sized(make, size)
        return vertices + bend(vertices), faces

    return dense
