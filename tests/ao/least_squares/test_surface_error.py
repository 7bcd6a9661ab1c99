"""The error that the surface method reports is the true one, on meshes drawn by seed: coarse, buried, uneven."""

import warnings
from functools import cache

import numpy as np
import pytest
import trimesh
from meshes import hills
from scipy.spatial.transform import Rotation

from benchmarks.accuracy.surface_error import Points
from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.scenes.geometry.builtin_shapes import temple
from obscurance.scenes.geometry.polyhedra import join

WITHIN = 1.35


def floor(rng, height=0.0):
    """A square that is cut more or less finely, level or hilly."""
    vertices, faces = hills(int(rng.integers(16, 30)))
    x, y = (vertices[:, :2] / np.abs(vertices[:, :2]).max() * 2).T
    return np.column_stack([x, y, height * np.sin(2 * x + rng.uniform(0, 6)) * np.sin(3 * y)]), faces


def ball_in_a_floor(rng):
    """What is below the floor is in sight of nothing."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    place = [*rng.uniform(-0.5, 0.5, 2), rng.uniform(-0.7, 0.1)]
    return [floor(rng), (ball.vertices * rng.uniform(0.5, 1.0) + place, np.asarray(ball.faces))]


def boxes_on_a_floor(rng):
    """Of two large faces a side, or of many; on it, a hair above it, or sunk into it."""
    parts = [floor(rng)]
    for _ in range(4):
        sides = rng.uniform(0.2, 0.9, 3)
        box = trimesh.creation.box(sides)
        for _ in range(rng.integers(0, 4)):
            box = box.subdivide()
        turned = box.vertices @ Rotation.from_euler("z", rng.uniform(0, 2)).as_matrix().T
        height = sides[2] / 2 - rng.choice([0, -1e-4, 0.1])
        parts.append((turned + np.append(rng.uniform(-1.3, 1.3, 2), height), np.asarray(box.faces)))
    return parts


def cones_on_a_terrain(rng):
    """Cones of long faces, which err by far more than the small ones around them."""
    parts = [floor(rng, 0.2)]
    for _ in range(2):
        cone = trimesh.creation.cone(rng.uniform(0.2, 0.6), rng.uniform(0.4, 1.2), sections=int(rng.integers(6, 30)))
        parts.append((cone.vertices + np.append(rng.uniform(-1, 1, 2), -0.2), np.asarray(cone.faces)))
    return parts


def sponge(rng):
    """Cubes of a grid with holes through it; every square has corners of its own, and few samples."""
    solid = rng.random((4, 4, 4)) < 0.6
    around = np.pad(solid, 1)
    quads = []
    for axis in range(3):
        for side in (0, 1):
            at_border = solid & ~np.roll(around, 1 - 2 * side, axis)[1:-1, 1:-1, 1:-1]
            across, up = np.roll(np.eye(3), axis + 1, axis=1)[:2]
            quad = np.array([0 * up, across, across + up, up])[:: 2 * side - 1]
            quads.append(np.argwhere(at_border)[:, None] + side * np.roll(np.eye(3), axis, axis=1)[0] + quad)
    corners = np.concatenate(quads).reshape(-1, 3)
    first = np.arange(0, len(corners), 4)[:, None, None]
    return [(corners, (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3))]


KINDS = (ball_in_a_floor, boxes_on_a_floor, cones_on_a_terrain, sponge)


def bake(mesh, falloff, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ao.ToleranceWarning)
        return ao.bake(mesh, falloff, method="surface", **options)


def parts_in_sight(mesh):
    """How much (n,) of the surface around each vertex is in sight, by brute force."""
    points = Points(mesh, 20_000, 32)
    around, in_sight = (
        np.bincount(points.corners.ravel(), (counted * points.weights).ravel(), len(mesh.vertices))
        for counted in (1.0, ~points.hidden[:, None])
    )
    return in_sight / np.maximum(around, 1e-9)


def ratios(mesh, falloff, seed, *several):
    """The reported error by each of several options relative to the true one, by how much is in sight around vertices.

    A tolerance is kept, or said not to be.
    """
    dense, in_sight = bake(mesh, falloff, samples=1 << 13, seed=99 + seed), parts_in_sight(mesh)
    for options in several:
        bakes = [bake(mesh, falloff, seed=seed + turn, **options) for turn in range(2)]
        true = np.sqrt(np.mean([np.average((baked.w - dense.w) ** 2, weights=in_sight) for baked in bakes]))
        reported = np.sqrt(np.mean([baked.rmse**2 for baked in bakes]))
        yield reported / true
        tolerance = options.get("tolerance", 1.0)
        assert true < 1.1 * tolerance or any("tolerance" in line for baked in bakes for line in baked.shortfalls)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_of_drawn_meshes(kind):
    mesh = Mesh(*join(kind(np.random.default_rng([5, KINDS.index(kind)]))))
    for ratio in ratios(mesh, ao.Binary(), 5, {"samples": 128}, {"tolerance": 0.02}):
        assert 1 / WITHIN < ratio < WITHIN


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_of_meshes_drawn_anew(kind, pytestconfig):
    """Errors of .003 and less are reported as up to twice as large; few rays on cones as two thirds."""
    found = []
    for seed in range(pytestconfig.option.mesh_seed, pytestconfig.option.mesh_seed + 4):
        rng = np.random.default_rng([seed, KINDS.index(kind)])
        mesh, falloff = Mesh(*join(kind(rng))), (ao.Binary(), ao.Exponential())[seed % 2]
        found += ratios(mesh, falloff, seed % 1000, {"samples": 128}, {"samples": 1024}, {"tolerance": 0.005})
    assert 1 / WITHIN < np.exp(np.mean(np.log(found))) < 1.6, found
    assert 0.55 < min(found) <= max(found) < 2.6, found


@cache
def coarse_temple():
    """The mesh, and what many rays make of it."""
    mesh = temple(fineness=0.6)
    return mesh, bake(mesh, ao.Binary(), samples=1024, seed=99).w


@pytest.mark.parametrize("samples", [16, 256])
def test_over_all_vertices(samples):
    mesh, reference = coarse_temple()
    bakes = [bake(mesh, ao.Binary(), samples=samples, seed=seed) for seed in range(2)]
    true = np.sqrt(np.mean([(baked.w - reference) ** 2 for baked in bakes]))
    reported = np.sqrt(np.mean([baked.rmse**2 for baked in bakes]))
    assert 1 / 1.4 < reported / true < WITHIN
    off = np.abs(bakes[0].w - reference)
    order = np.argsort(bakes[0].error)
    quarter = len(off) // 4
    assert np.sqrt(np.mean(off[order[-quarter:]] ** 2)) > 2 * np.sqrt(np.mean(off[order[:quarter]] ** 2))
