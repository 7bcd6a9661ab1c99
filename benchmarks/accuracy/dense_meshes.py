"""Dense meshes from seeds: the same surface at two densities, and surfaces on which w jumps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import trimesh

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.geometry.polyhedra import join

Floats = npt.NDArray[np.float64]
SIDE = 400  # vertices along each edge of the grids on which w jumps


def waves(seed: int, places: Floats, lowest: float, octaves: int, gain: float) -> Floats:
    """Sums (n,) of plane waves at `places` (n, d): twelve an octave, from `lowest` on, each octave `gain` as high."""
    random = np.random.default_rng(seed)
    total, dimensions = np.zeros(len(places)), places.shape[1]
    for octave in range(octaves):
        for _ in range(12):
            direction = random.normal(size=dimensions)
            direction *= lowest * 2.0**octave / np.linalg.norm(direction)
            total += gain**octave * np.sin(places @ direction + random.uniform(0, 2 * np.pi)) / np.sqrt(12)
    return total


def subdivided(mesh: Mesh, times: int = 2) -> Mesh:
    """In 4^`times` times as many faces, smoothed by Loop's scheme; flat where three faces share an edge."""
    used, corners = np.unique(mesh.faces, return_inverse=True)
    vertices, faces = mesh.vertices[used], corners.reshape(-1, 3)
    try:
        smoothed = trimesh.remesh.subdivide_loop(vertices, faces, iterations=times)
    except ValueError:  # Loop's scheme has no rule for such an edge
        for _ in range(times):
            vertices, faces = trimesh.remesh.subdivide(vertices, faces)
        return Mesh(vertices, faces, source=f"{mesh.source}, subdivided")
    return Mesh(*smoothed, source=f"{mesh.source}, Loop")


def grid(height: Callable[[Floats, Floats], Floats], side: int, source: str) -> Mesh:
    """The height field z = height(x, y) over [−1, 1]² in side² vertices."""
    steps = np.linspace(-1, 1, side)
    x, y = (axis.ravel() for axis in np.meshgrid(steps, steps, indexing="ij"))
    cell = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    lower, upper = (cell, cell + side, cell + side + 1), (cell, cell + side + 1, cell + 1)
    faces = np.concatenate([np.stack(corners, axis=-1) for corners in (lower, upper)])
    return Mesh(np.stack([x, y, height(x, y)], axis=-1), faces, source=source)


def bumpy_spheres(seed: int) -> tuple[Mesh, Mesh]:
    def sphere(subdivisions: int) -> Mesh:
        ball = trimesh.creation.icosphere(subdivisions=subdivisions)
        radius = 1 + 0.12 * waves(seed, ball.vertices, 4.0, 2, 0.5)
        return Mesh(ball.vertices * radius[:, None], ball.faces, source=f"bumpy sphere {seed}")

    return sphere(5), sphere(7)


def height_fields(seed: int) -> tuple[Mesh, Mesh]:
    def height(x: Floats, y: Floats) -> Floats:
        return 0.1 * waves(seed, np.stack([x, y], axis=-1), 6.0, 3, 0.45)

    return grid(height, 120, f"height field {seed}"), grid(height, 480, f"height field {seed}")


def generated_scans(seed: int) -> tuple[Mesh, Mesh]:
    """A sphere with noise of all sizes down to two edges, and by Loop's scheme denser."""
    ball = trimesh.creation.icosphere(subdivisions=5)
    radius = 1 + 0.14 * waves(seed, ball.vertices, 2.5, 5, 0.6)
    base = Mesh(ball.vertices * radius[:, None], ball.faces, source=f"generated scan {seed}")
    return base, subdivided(base)


PAIRS = {"bumpy sphere": bumpy_spheres, "height field": height_fields, "generated scan": generated_scans}


def posts(seed: int) -> Mesh:
    """Sixty posts, one to six cells wide, on a slab."""
    random, cell = np.random.default_rng(seed), 2 / SIDE
    slab = grid(lambda x, _: 0 * x, SIDE, "posts")
    corners = np.array([(i, j, k) for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (0.0, 1.0)])
    sides = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                      [1, 5, 7], [1, 7, 3]])  # fmt: skip
    parts = [(slab.vertices, slab.faces)]
    for _ in range(60):
        width = cell * random.uniform(1, 6)
        size = np.array([width, width, random.uniform(0.05, 0.4)])
        parts.append((corners * size + [*random.uniform(-0.95, 0.95, 2), 0.0], sides))
    return Mesh(*join(parts), source=f"posts {seed}")


def walls(seed: int) -> Mesh:
    """Twelve thin walls across a slab."""
    random = np.random.default_rng(seed)
    slab = grid(lambda x, _: 0 * x, SIDE, "walls")
    parts = [(slab.vertices, slab.faces)]
    for _ in range(12):
        middle, angle = random.uniform(-0.8, 0.8, 2), random.uniform(0, np.pi)
        along = random.uniform(0.2, 0.8) * np.array([np.cos(angle), np.sin(angle)])
        foot = np.array([[*(middle - along), 0.0], [*(middle + along), 0.0]])
        top = foot + np.array([0.0, 0.0, random.uniform(0.05, 0.4)])
        parts.append((np.concatenate([foot, top]), np.array([[0, 1, 3], [0, 3, 2]])))
    return Mesh(*join(parts), source=f"walls {seed}")


def bumps(seed: int) -> Mesh:
    def height(x: Floats, y: Floats) -> Floats:
        return 0.05 * waves(seed, np.stack([x, y], axis=-1), 8.0, 3, 0.6)

    return grid(height, SIDE, f"bumpy height field {seed}")


def creases(seed: int) -> Mesh:
    """A height field of planes that meet in sharp valleys and ridges."""

    def height(x: Floats, y: Floats) -> Floats:
        places = np.stack([x, y], axis=-1)
        return 0.25 * np.abs(waves(seed, places, 7.0, 1, 1.0)) + 0.1 * np.abs(waves(seed + 1, places, 15.0, 1, 1.0))

    return grid(height, SIDE, f"sharp creases {seed}")


JUMPS = {"posts": posts, "walls": walls, "bumpy height field": bumps, "sharp creases": creases}
