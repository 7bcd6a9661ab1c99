"""Solids and sheets at any fineness, of which the families are made: boxes, balls, pipes, rings, sheets."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from meshes import raw_mesh
from scipy.spatial.transform import Rotation

from obscurance.raytrace.types import Float64s
from obscurance.scenes.geometry.polyhedra import RawMesh
from obscurance.scenes.geometry.primitives import box as hard_box
from obscurance.scenes.geometry.primitives import cylinder as hard_cylinder

from .dense import Make, Rng, welded

Surface = Callable[[Float64s, Float64s], Float64s]


def sheet(surface: Surface, rows: int, columns: int) -> RawMesh:
    """Points (…, 3) of s and t (…) in [0, 1] on a lattice of `rows` × `columns` cells, facing ∂s × ∂t, seams closed."""
    s, t = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    index = np.arange(s.size).reshape(s.shape)
    a, b, c, d = (corner.ravel() for corner in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return welded((surface(s, t).reshape(-1, 3), faces))


def cells(length: float, fineness: float, least: int = 1) -> int:
    """How many cells of at most `fineness` make `length`."""
    return max(int(np.ceil(length / fineness)), least)


def plane(width: float, depth: float, fineness: float) -> RawMesh:
    """A rectangle in z = 0 about the origin, facing +z."""
    return sheet(
        lambda s, t: np.stack([width * (s - 0.5), depth * (t - 0.5), np.zeros_like(s)], -1),
        cells(width, fineness),
        cells(depth, fineness),
    )


def box(size: tuple[float, float, float], fineness: float, hard: bool = True) -> RawMesh:
    """A box about the origin; its sides have vertices of their own if `hard`."""
    part = raw_mesh(hard_box((0, 0, 0), size, fineness).mesh)
    return part if hard else welded(part)


def ball(radius: float, fineness: float) -> RawMesh:
    """A sphere about the origin: a cube blown up, so that it has no poles."""
    vertices, faces = box((2.0, 2.0, 2.0), 2 * fineness / (1.6 * radius) if fineness < radius else 1.0, hard=False)
    vertices = np.tan(vertices * np.pi / 4)
    return radius * vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def cylinder(radius: float, height: float, fineness: float, hard: bool = True) -> RawMesh:
    """A closed cylinder about the origin along z."""
    part = raw_mesh(hard_cylinder(radius, height, fineness).mesh)
    return part if hard else welded(part)


def ring(radius: float, thickness: float, fineness: float) -> RawMesh:
    """A torus about z; `thickness` is the radius of its tube."""

    def surface(s: Float64s, t: Float64s) -> Float64s:
        around, across = 2 * np.pi * (s % 1.0), 2 * np.pi * (t % 1.0)
        out = radius + thickness * np.cos(across)
        return np.stack([out * np.cos(around), out * np.sin(around), thickness * np.sin(across)], -1)

    return sheet(surface, cells(2 * np.pi * radius, fineness, 8), cells(2 * np.pi * thickness, fineness, 6))


def capsule(radius: float, length: float, fineness: float) -> RawMesh:
    """A cylinder along z with half spheres at ±length/2."""
    quarter = np.pi / 2 * radius
    total = 2 * quarter + length

    def surface(s: Float64s, t: Float64s) -> Float64s:
        way = t * total
        bow = np.clip(way, 0, quarter) + np.clip(way - quarter - length, 0, quarter)
        angle = bow / radius - np.pi / 2
        height = radius * np.sin(angle) + np.clip(way - quarter, 0, length) - length / 2
        out = np.where((t == 0) | (t == 1), 0.0, radius * np.cos(angle))
        around = 2 * np.pi * (s % 1.0)
        return np.stack([out * np.cos(around), out * np.sin(around), height], -1)

    return sheet(surface, cells(2 * np.pi * radius, fineness, 8), cells(total, fineness, 8))


def knot(rng: Rng, radius: float) -> Make:
    """A closed pipe along a random smooth curve of about unit size; it may run through itself."""
    waves = rng.normal(size=(2, 3, 3)) / np.array([1.0, 1.6, 2.5])[:, None]

    def centre(s: Float64s) -> Float64s:
        turns = 2 * np.pi * (s % 1.0)[..., None] * np.arange(1, 4)
        return 0.3 * (np.cos(turns) @ waves[0] + np.sin(turns) @ waves[1])

    def surface(s: Float64s, t: Float64s) -> Float64s:
        along = centre(s + 1e-4) - centre(s - 1e-4)
        along /= np.linalg.norm(along, axis=-1, keepdims=True)
        side = np.cross(along, centre(s) + np.array([0.0, 0.0, 3.0]))
        side /= np.linalg.norm(side, axis=-1, keepdims=True)
        angle = 2 * np.pi * (t % 1.0)[..., None]
        return centre(s) + radius * (np.cos(angle) * side - np.sin(angle) * np.cross(along, side))

    steps = centre(np.linspace(0, 1, 200))
    length = float(np.linalg.norm(np.diff(steps, axis=0), axis=1).sum())
    return lambda fineness: sheet(surface, cells(length, fineness, 12), cells(2 * np.pi * radius, fineness, 6))


def moved(part: RawMesh, shift: Float64s, turn: Rotation | None = None, stretch: Float64s | float = 1.0) -> RawMesh:
    """Stretched along the axes, then turned, then shifted."""
    vertices = part[0] * stretch
    return (vertices if turn is None else turn.apply(vertices)) + shift, part[1]


def random_turn(rng: Rng, upright: bool = False) -> Rotation:
    """Any rotation, or any about z."""
    return (
        Rotation.from_rotvec([0, 0, rng.uniform(0, 2 * np.pi)]) if upright else Rotation.from_quat(rng.normal(size=4))
    )


def solid(rng: Rng, size: float) -> Make:
    """A ball, ellipsoid, capsule, ring, box, cylinder or knot of about `size`, turned somehow, about the origin."""
    kind, turn, hard = rng.integers(7), random_turn(rng), bool(rng.random() < 0.5)
    a, b, c = size / 2 * rng.uniform(0.4, 1.0, 3)
    pipe = knot(rng, rng.uniform(0.04, 0.1))
    make: Make = (
        lambda h: ball(a, h),
        lambda h: moved(ball(1.0, h / max(a, b, c)), np.zeros(3), None, np.array([a, b, c])),
        lambda h: capsule(0.6 * b, 1.4 * a, h),
        lambda h: ring(a, 0.4 * min(a, b), h),
        lambda h: box((a, b, c), h, hard),
        lambda h: cylinder(0.6 * b, 1.6 * a, h, hard),
        lambda h: moved(pipe(h / size), np.zeros(3), None, size),
    )[kind]
    return lambda h: moved(make(h), np.zeros(3), turn)
