"""Surfaces of a number of vertices, displacement by smooth random fields, random placement."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.types import Float64s
from obscurance.scenes.geometry.polyhedra import RawMesh

Rng = np.random.Generator
Field = Callable[[Float64s], Float64s]
Make = Callable[[float], RawMesh]
SURPLUS = 1.25  # vertices more than asked for that `sized` is content with
_SAME = 1e-7  # of a part's extent: vertices nearer than this are one


def log_uniform(rng: Rng, low: float, high: float) -> float:
    """A number between `low` and `high`, every power of ten as likely."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def field(rng: Rng, low: float = 0.3, high: float = 4.0) -> Field:
    """A smooth random function of points (n, 3), mean 0 and variance 1: 24 waves of `low` to `high` per unit length."""
    waves = rng.normal(size=(24, 3))
    waves *= (
        2 * np.pi * np.exp(rng.uniform(np.log(low), np.log(high), (24, 1))) / np.linalg.norm(waves, axis=1)[:, None]
    )
    phases = rng.uniform(0, 2 * np.pi, 24)
    return lambda points: np.cos(points @ waves.T + phases).sum(axis=1) / np.sqrt(12)


def displacement(rng: Rng, height: float, low: float = 0.3, high: float = 3.0) -> Field:
    """Displacements (n, 3) of points (n, 3): three fields of at most `high` waves per unit length, slope `height`."""
    fields = [field(rng, low, high) for _ in range(3)]
    return lambda points: height / (2 * np.pi * high) * np.stack([f(points) for f in fields], axis=-1)


def extent(part: RawMesh) -> float:
    """The longest side of the bounding box."""
    return float(np.ptp(part[0], axis=0).max())


def welded(part: RawMesh) -> RawMesh:
    """One vertex for those at one place; without faces that lose their area by it, or vertices of no face."""
    steps = np.round(part[0] / (_SAME * max(extent(part), 1e-300))).astype(np.int64)
    _, first, group = np.unique(steps, axis=0, return_index=True, return_inverse=True)
    return used((part[0][first], group.reshape(-1)[part[1]]))


def used(part: RawMesh) -> RawMesh:
    """Without faces of fewer than three vertices, and without vertices of no face."""
    faces = part[1]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    kept, index = np.unique(faces, return_inverse=True)
    return part[0][kept], index.reshape(faces.shape)


def places(part: RawMesh) -> int:
    """How many places the vertices of faces are at that differ by a millionth of the part's extent, as they do wherever
    `placed` moves it; a bake has at least as many points."""
    return len(np.unique(np.round(part[0][np.unique(part[1])] / (1e-6 * extent(part))), axis=0))


def sized(make: Make, size: int, most: float = SURPLUS) -> RawMesh:
    """make(fineness), the same part at any fineness, so fine that it has `size` to `most`·`size` places of vertices.

    Where the number jumps past that, the coarsest found that has `size`.
    """
    low, high, fineness, before, found = 0.0, np.inf, 0.05, 0, None
    for _ in range(24):
        part = make(fineness)
        count = places(part)
        if count >= size:
            found, low = part, max(low, fineness)
            if count <= most * size or count == before:
                break
        else:
            high = min(high, fineness)
        guess = fineness * float(np.sqrt(count / (1.1 * size))) * (0.5 if count == before else 1.0)
        before = count
        fineness = guess if low < guess < high else float(np.sqrt(max(low, high / 8) * min(high, 8 * low)))
    if found is None:
        raise ValueError(f"no fineness down to {fineness:g} gives {size} vertices")
    return found


def placed(part: RawMesh, rng: Rng, source: str) -> Mesh:
    """Somewhere in space, of some size, turned somehow, or one time in four along the axes."""
    turn = Rotation.from_quat(rng.normal(size=4)) if rng.random() < 0.75 else Rotation.identity()
    scale, away = log_uniform(rng, 1e-2, 1e2), rng.normal(size=3)
    vertices = scale * (turn.apply(part[0]) + extent(part) * away)
    return Mesh(vertices, part[1], source=source)
