"""Validation scenes of planes and polygons, where the only error beside the estimator's is truncation."""

from math import cos, inf, pi, radians, sin

import numpy as np

from obscurance.ao import closed_forms as analytic
from obscurance.ao.closed_forms import polygon_form_factor
from obscurance.ao.falloff import Binary, Exponential, Falloff, Linear, Smooth
from obscurance.raytrace.types import Float64s

from ..geometry.polyhedra import generic_rotation, hull, icosphere, join, patches, polygon
from .configurations import BOTH, ClosedForm, ValidationCase, closed_form, posed

_Point = tuple[float, float, float]
UP = np.array([0.0, 0.0, 1.0])
FAR = 1000.0  # binary stand-ins of infinite walls: they miss about distance/(2·FAR)
NEAR = 60.0  # exponential ones: e^(−τ·NEAR) of that
# Sets whose standard error at 4,096 rays is about .001, so that an error above .004 is a fault and not bad luck; edges
# can be so many, or lie so, that it reaches .0018.
TRIANGLE_SEEDS = (0, 1, 2, 3, 6, 7)


def flat_cases() -> list[ValidationCase]:
    """Cases whose occluders are planes and polygons, with exact w."""
    return [
        *_open(),
        _ceiling(),
        *_walls(FAR, (Binary(),)),
        *_walls(NEAR, (Exponential(tau=0.4), Exponential(tau=2.0))),
        *_trenches(),
        *_boxes(),
        _tilted(),
        *map(_inverted_pyramid, (3, 4, 512)),
        *map(_triangles, TRIANGLE_SEEDS),
        _pentagon(),
    ]


def _case(
    points: list[_Point],
    name: str,
    occluders: list[Float64s],
    exact: ClosedForm | None,
    falloffs: tuple[Falloff, ...],
    *,
    beyond: float = inf,
    patch: float = 0.1,
    seed: int | None = None,
) -> ValidationCase:
    """Receivers in the plane z = 0 under convex polygons.

    Args: exact: None: by Lambert's formula, which else measures what an infinite truth misses.
    """
    mesh = posed(join([patches(points, patch), *map(polygon, occluders)]), seed, source=name)
    open_parts = 1.0 - np.array([sum(polygon_form_factor(occluder, p, UP) for occluder in occluders) for p in points])
    missing = float(np.abs(np.subtract(exact(None, inf), open_parts)).max()) if exact and beyond < inf else 0.0
    first_corners = 3 * np.arange(len(points))
    return ValidationCase(
        name, mesh, first_corners, exact or (lambda *_: open_parts), falloffs, missing=missing, beyond=beyond
    )


def _rectangle(corner: _Point, u: _Point, v: _Point) -> Float64s:
    """The corners (4, 3) of the rectangle with sides u and v from one corner."""
    a, b, c = np.array([corner, u, v], float)
    return np.array([a, a + b, a + b + c, a + c])


def _open() -> list[ValidationCase]:
    """Convex shapes, above whose vertices there is nothing: w = 1."""
    directions = np.random.default_rng(1).normal(size=(40, 3))
    shapes = {
        "plane": patches(np.random.default_rng(0).normal(size=(8, 3)) * [1.0, 1.0, 0.0], 0.5),
        "cube from outside": hull([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]),
        "tetrahedron": hull([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]),
        "icosphere": icosphere(1),
        "convex hull": hull(directions / np.linalg.norm(directions, axis=1, keepdims=True) * [1.0, 0.7, 0.2]),
    }
    return [
        ValidationCase(
            f"nothing above: {shape}", posed(part, seed, source=shape), np.arange(len(part[0])), lambda *_: 1.0, BOTH
        )
        for seed, (shape, part) in enumerate(shapes.items())
    ]


def _ceiling() -> ValidationCase:
    size, height = 100.0, 0.7
    slab = _rectangle((-size, -size, height), (2 * size, 0, 0), (0, 2 * size, 0))
    limits = (Binary(2 * height), Exponential(tau=1.0, max_distance=2 * height), Binary(0.9 * height))
    falloffs = (*BOTH, Exponential(tau=5.0), *limits, Linear(2 * height), Smooth(3 * height))
    exact = closed_form(analytic.ceiling, (height,))
    points = [(0.0, 0.0, 0.0), (3.0, -2.0, 0.0)]
    return _case(points, "ceiling", [slab], exact, falloffs, beyond=size - 3.0, patch=1.0, seed=10)


def _walls(extent: float, falloffs: tuple[Falloff, ...]) -> list[ValidationCase]:
    """Points before a wall, in a corner of two walls and in V-grooves.

    Args: extent: of the walls, in place of infinity.
    """
    points = [(0.5, 0.5, 0.0), (1.0, 0.4, 0.0)]
    tall = _rectangle((0, -extent, 0), (0, 2 * extent, 0), (0, 0, extent))
    quarter = [_rectangle((0, 0, 0), along, (0, 0, extent)) for along in ((extent, 0, 0), (0, extent, 0))]
    limited = () if extent == FAR else (Binary(1.5), Exponential(tau=0.4, max_distance=1.5), Linear(3.0), Smooth(3.0))
    lines = [
        ("infinite wall", [tall], closed_form(analytic.wall, *((x, inf) for x, _, _ in points)), falloffs + limited),
        ("corner of two walls", quarter, closed_form(analytic.corner, *(p[:2] for p in points)), falloffs),
    ]
    for degrees in (40, 90, 140):
        angle = radians(degrees)
        side = _rectangle((0, -extent, 0), (0, 2 * extent, 0), (extent * cos(angle), 0, extent * sin(angle)))
        exact = closed_form(analytic.groove, *((angle, x) for x, _, _ in points))
        lines.append((f"V-groove of {degrees}°", [side], exact, falloffs))
    beyond = extent - 2.0
    patch = 0.3 * extent
    return [_case(points, *row, beyond=beyond, patch=patch, seed=seed) for seed, row in enumerate(lines, 11)]


def _trenches() -> list[ValidationCase]:
    """Points on the floor of a trench, and beside one of its walls."""
    length, depth, width = 20.0, 0.8, 1.0
    left = _rectangle((0, -length, 0), (0, 2 * length, 0), (0, 0, depth))
    right = _rectangle((width, -length, 0), (0, 2 * length, 0), (0, 0, depth))
    falloffs = (Binary(), Exponential(tau=2.0), Binary(0.9), Exponential(tau=2.0, max_distance=0.9), Linear(0.9))
    points = [(0.25, 0.0, 0.0), (0.5, 1.0, 0.0), (0.9, -1.0, 0.0)]
    trench = closed_form(analytic.trench, *((x, width - x, depth) for x, _, _ in points))
    wall = closed_form(analytic.wall, *((width - x, depth) for x, _, _ in points))
    return [
        _case(points, "trench", [right, left], trench, falloffs, beyond=length - 1),
        _case(points, "wall", [right], wall, falloffs, beyond=length - 1, seed=16),
    ]


def _boxes() -> list[ValidationCase]:
    cube = ((0.5, 0.5, 0.5, 0.5), 1.0)
    limited = (Binary(0.7), Exponential(tau=1.0, max_distance=0.8), Exponential(tau=1.0, max_distance=1.2), Linear(1.2))
    falloffs = (*BOTH, Exponential(tau=5.0), *limited)
    return [
        _box("closed unit cube", None, *cube, falloffs),
        _box("closed unit cube, turned", 17, *cube, falloffs),
        _box("closed box", 18, (0.2, 0.5, 0.9, 0.3), 0.4, (*BOTH, *limited)),
    ]


def _box(
    name: str, seed: int | None, sides: tuple[float, float, float, float], height: float, falloffs: tuple[Falloff, ...]
) -> ValidationCase:
    """A point on the floor of a closed box. Args: sides: distances of its walls at +x, +y, −x and −y."""
    corners = np.array([(x, y, z) for x in (-sides[2], sides[0]) for y in (-sides[3], sides[1]) for z in (0.0, height)])
    vertices, faces = hull(corners)
    walls = faces[:, ::-1][(vertices[faces][:, :, 2] > 0).any(axis=1)]
    floor = np.array([[0, 0, 0], *corners[[0, 4, 6, 2]]], dtype=np.float64)
    fan = np.array([[0, i, i % 4 + 1] for i in range(1, 5)])
    mesh = posed(join([(floor, fan), (vertices, walls)]), seed, source=name)
    return ValidationCase(name, mesh, np.array([0]), closed_form(analytic.box, (sides, height)), falloffs)


def _tilted() -> ValidationCase:
    """Vertices of a plane with normals that are tilted."""
    tilts = np.radians([15.0, 45.0, 80.0])
    angles = 2 * pi * np.arange(6) / 6
    points = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])
    fan = np.concatenate([np.zeros((1, 3)), np.stack([np.cos(angles), np.sin(angles), np.zeros(6)], axis=-1)])
    vertices = (points[:, None] + fan).reshape(-1, 3)
    faces = np.array([[7 * k, 7 * k + 1 + i, 7 * k + 1 + (i + 1) % 6] for k in range(3) for i in range(6)])
    normals = np.full_like(vertices, np.nan)
    normals[::7] = [(sin(t) * cos(5 * t), sin(t) * sin(5 * t), cos(t)) for t in tilts]
    mesh = posed((vertices, faces), 19, normals, source="tilted normal")
    exact = [analytic.tilted_normal(t) for t in tilts]
    return ValidationCase("tilted normal", mesh, 7 * np.arange(3), lambda *_: exact, (Binary(),), normals="file")


def _inverted_pyramid(sides: int) -> ValidationCase:
    """The point of a pyramid that stands on it, seen from within."""
    slope = 0.7
    angles = 2 * pi * np.arange(sides) / sides
    rim = np.stack([np.cos(angles), np.sin(angles), np.full(sides, slope * cos(pi / sides))], axis=-1)
    faces = np.array([[0, k, k % sides + 1] for k in range(1, sides + 1)])
    name = f"inverted pyramid of {sides} sides"
    mesh = posed((np.concatenate([np.zeros((1, 3)), rim]), faces), 21, source=name)
    return ValidationCase(name, mesh, np.array([0]), lambda *_: analytic.inverted_pyramid(sides, slope), (Binary(),))


def _triangles(seed: int) -> ValidationCase:
    """Triangles at any height and slant, some through the horizon, that don't overlap as seen from the origin.

    Directions to their corners are a triangulated sphere's, and each corner moves along its direction.
    """
    rng = np.random.default_rng(100 + seed)
    directions = rng.normal(size=(9, 3))
    directions, faces = hull(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    chosen = faces[rng.random(len(faces)) < 0.4]
    occluders = list(directions[chosen] * rng.uniform(0.5, 3.0, size=(len(chosen), 3, 1)))
    name = f"polygons by Lambert's formula, {len(occluders)} triangles"
    return _case([(0.0, 0.0, 0.0)], name, occluders, None, (Binary(),), seed=seed)


def _pentagon() -> ValidationCase:
    angles = 2 * pi * np.arange(5) / 5
    corners = np.stack([np.cos(angles), 1.3 * np.sin(angles), np.zeros(5)], axis=-1)
    pentagon = generic_rotation(3).apply(corners) + np.array([0.2, 0.1, 0.6])
    points = [(0.0, 0.0, 0.0), (1.0, 0.5, 0.0), (-0.8, 0.9, 0.0), (0.5, -1.2, 0.0), (-2.0, -0.5, 0.0)]
    return _case(points, "polygon by Lambert's formula, pentagon", [pentagon], None, (Binary(),), seed=20)
