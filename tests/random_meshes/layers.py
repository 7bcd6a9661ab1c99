"""Layered surfaces and jumps of scale: thin sheets, nested shells, triangulated planar points."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.types import Float64s
from obscurance.scenes.geometry.polyhedra import RawMesh, join

from .dense import Make, Rng, displacement, field, log_uniform, placed, sized
from .pieces import ball, box, cells, moved, plane, random_turn, sheet, solid


def thin_sheets(rng: Rng, size: int) -> Mesh:
    """Bent sheets one above the other, hardly apart, some with holes, some rolled up."""
    waves, bend = field(rng, 0.4, 2.5), log_uniform(rng, 0.01, 0.2)
    count, rolled = int(rng.integers(2, 9)), rng.random() < 0.25
    levels = np.cumsum(np.exp(rng.uniform(np.log(1e-5), np.log(0.15), count)))
    widths, sides = rng.uniform(0.3, 1.0, (count, 2)), rng.random(count) < 0.5
    holes = rng.uniform(-0.5, 0.5, (count, 4, 2)), rng.uniform(0.0, 0.2, (count, 4))
    turns = rng.uniform(1.5, 4.0)

    def layer(k: int, h: float) -> RawMesh:
        def surface(s: Float64s, t: Float64s) -> Float64s:
            x, y = widths[k, 0] * (s - 0.5), widths[k, 1] * (t - 0.5)
            z = bend * waves(np.stack([x, y, 0 * x], -1).reshape(-1, 3)).reshape(x.shape)
            return np.stack([x, y, z + levels[k]], -1)

        vertices, faces = sheet(surface, cells(widths[k, 0], h), cells(widths[k, 1], h))
        middle = vertices[faces].mean(axis=1)[:, :2]
        open_ = [
            np.linalg.norm(middle - hole, axis=1) > radius
            for hole, radius in zip(holes[0][k], holes[1][k], strict=True)
        ]
        kept = np.all(open_, axis=0)
        faces = faces[kept] if kept.any() else faces
        return vertices, faces[:, ::-1] if sides[k] else faces

    def roll(h: float) -> RawMesh:
        def surface(s: Float64s, t: Float64s) -> Float64s:
            angle = 2 * np.pi * turns * s
            out = 0.05 + 0.02 * angle
            return np.stack([out * np.cos(angle), out * np.sin(angle), 0.8 * t], -1)

        return sheet(surface, cells(0.1 * np.pi * turns**2, h), cells(0.8, h))

    return placed(
        sized(roll if rolled else lambda h: join([layer(k, h) for k in range(count)]), size), rng, "thin sheets"
    )


def nested_shells(rng: Rng, size: int) -> Mesh:
    """Bumpy shells one inside the other, near or far, with holes that let light in, some of them facing inward."""
    count = int(rng.integers(2, 7))
    radii = np.cumprod(np.r_[1.0, 1 - np.exp(rng.uniform(np.log(1e-3), np.log(0.4), count - 1))])
    bumps = displacement(rng, rng.uniform(0.0, 1.0))
    inward = rng.random(count) < 0.5
    holes = [rng.normal(size=(int(rng.integers(0, 12)), 3)) for _ in range(count)]
    width = [np.exp(rng.uniform(np.log(0.02), np.log(0.5), len(h))) for h in holes]

    def make(h: float) -> RawMesh:
        skin, triangles = ball(1.0, h)
        parts = []
        for radius, turned, directions, wide in zip(radii, inward, holes, width, strict=True):
            middle = skin[triangles].mean(axis=1)
            kept = np.ones(len(triangles), np.bool_)
            for direction, angle in zip(directions, wide, strict=True):
                kept &= middle @ direction < np.cos(angle) * np.linalg.norm(direction)
            faces = triangles[kept]
            parts.append((radius * (skin + bumps(skin)), faces[:, ::-1] if turned else faces))
        return join(parts)

    return placed(sized(make, size), rng, "nested shells")


def scale_jumps(rng: Rng, size: int) -> Mesh:
    """Small detailed things on or through a ground 20 to 2,000 times as large, cut fine where they stand or nowhere."""
    power = rng.uniform(1.0, 5.0)
    things: list[tuple[Make, Float64s, float]] = []
    for _ in range(int(rng.integers(1, 5))):
        length = log_uniform(rng, 5e-4, 5e-2)
        bumps = displacement(rng, rng.uniform(0.0, 1.0))
        make, xy = solid(rng, 1.0), rng.normal(size=2) * 0.05
        lift = rng.choice([0.5, 0.3, 0.0, 0.5 + log_uniform(rng, 1e-4, 0.1)])

        def bumpy(h: float, make=make, bumps=bumps) -> RawMesh:
            vertices, faces = make(h)
            return vertices + bumps(vertices), faces

        things.append((bumpy, np.array([*xy, lift * length]), length))
    walls = rng.random() < 0.4
    wall = rng.uniform(0.05, 0.5), random_turn(rng, upright=True)

    def graded(s: Float64s, t: Float64s) -> Float64s:
        x, y = (np.sign(2 * u - 1) * np.abs(2 * u - 1) ** power / 2 for u in (s, t))
        return np.stack([x, y, np.zeros_like(x)], -1)

    def make_all(h: float) -> RawMesh:
        parts = [sheet(graded, cells(1.0, h), cells(1.0, h))]
        parts += [moved(make(2 * h), shift, None, length) for make, shift, length in things]
        if walls:
            parts.append(moved(box((0.8, 0.01, wall[0]), 8 * h), np.array([0, 0.1, wall[0] / 2]), wall[1]))
        return join(parts)

    return placed(sized(make_all, size), rng, "scale jumps")


def planar_sets(rng: Rng, size: int) -> Mesh:
    """Random points of a plane, crowded in places, triangulated, then folded along straight lines; boxes on it."""
    points = rng.uniform(-0.5, 0.5, (int(1.02 * size), 2))
    for _ in range(int(rng.integers(0, 4))):
        some = rng.random(len(points)) < 0.2
        points[some] = rng.uniform(-0.4, 0.4, 2) + log_uniform(rng, 0.005, 0.2) * rng.normal(size=(int(some.sum()), 2))
    stretch = np.array([1.0, log_uniform(rng, 0.05, 1.0)])
    faces = Delaunay(points).simplices.astype(np.int64)
    a, b, c = points[faces].transpose(1, 0, 2)
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces = np.where((turn > 0)[:, None], faces, faces[:, ::-1])[np.abs(turn) > 1e-14]
    height = np.zeros(len(points))
    for _ in range(int(rng.integers(0, 8))):
        way = rng.normal(size=2)
        height += rng.uniform(-0.8, 0.8) * np.maximum(points @ way / np.linalg.norm(way) - rng.uniform(-0.4, 0.4), 0)
    ground = np.column_stack([points * stretch, height]), faces
    boxes = []
    for _ in range(int(rng.integers(0, 6))):
        at, side = rng.integers(len(points)), rng.uniform(0.02, 0.15, 3)
        turned = random_turn(rng, upright=bool(rng.random() < 0.5))
        boxes.append((side, ground[0][at] + np.array([0, 0, side[2] * rng.choice([0.5, 0.3, 0.51])]), turned))

    standing = [moved(box((a, b, c), 0.01), foot, turned) for (a, b, c), foot, turned in boxes]
    return placed(join([ground, *standing]), rng, "planar sets")


def crossing_planes(rng: Rng, size: int) -> Mesh:
    """Dense rectangles through one another at any angle."""
    planes = [(random_turn(rng), rng.normal(size=3) * 0.2, rng.uniform(0.3, 1.0, 2)) for _ in range(rng.integers(3, 9))]

    def make(h: float) -> RawMesh:
        return join([moved(plane(a, b, h), shift, turn) for turn, shift, (a, b) in planes])

    return placed(sized(make, size), rng, "crossing planes")
