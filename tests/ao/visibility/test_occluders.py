"""Meshes that only occlude, a ground plane above all, against closed forms and joined bakes."""

import numpy as np
import pytest
from meshes import hills

from obscurance import ao
from obscurance.raytrace import AlphaSurface, Mesh, MeshError, Opacity, OptionError
from obscurance.raytrace.errors import ConflictError
from obscurance.raytrace.mesh.normals import vertex_normals
from obscurance.scenes.geometry.polyhedra import icosphere, join

BALL = Mesh(*icosphere(3))
UP = np.array([0.0, 1.0, 0.0])


def over_ground(normals, heights, falloff):
    """w of points over an endless plane, (n,), by a product rule in the angles of their hemispheres."""
    steps = (np.arange(64) + 0.5) / 64
    squared_sine, angle = np.meshgrid(steps, np.pi * steps)  # from the steepest direction, as the other half is
    along, across = np.sqrt(1 - squared_sine), np.sqrt(squared_sine) * np.cos(angle)
    up = normals[:, 1, None, None]
    slope = up * along + np.sqrt(np.maximum(1 - up**2, 0)) * across
    with np.errstate(divide="ignore"):
        distance = np.where(slope < 0, heights[:, None, None] / -slope, np.inf)
    return falloff(distance).mean(axis=(1, 2))


FALLOFFS = {
    "binary": (ao.Binary(), np.isinf),
    "near": (ao.Binary(max_distance=0.5), lambda d: d > 0.5),
    "exponential": (ao.Exponential(half_distance=0.4), lambda d: -np.expm1(-np.log(2) / 0.4 * d)),
}


@pytest.mark.parametrize("name", FALLOFFS)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_ball_over_the_ground(name, seed):
    falloff, mu = FALLOFFS[name]
    floor = ao.ground(BALL, -1.25)
    baked = ao.bake(BALL, falloff, 256, seed, occluders=[floor], denoise=False)
    normals = vertex_normals(BALL.vertices, BALL.faces)
    exact = over_ground(normals, BALL.vertices[:, 1] + 1.25, mu)
    assert len(baked.w) == len(BALL.vertices)
    missed = baked.w - exact
    assert missed.std() < min(1.3 * baked.rmse, 0.012)
    assert abs(missed.mean()) < 5 * missed.std() / len(missed) ** 0.5 + 2e-5


@pytest.mark.parametrize("options", [{"tolerance": 0.01}, {"method": "surface"}, {"samples": 256}])
def test_denoised_fitted_and_to_a_tolerance(options):
    baked = ao.bake(BALL, "binary", occluders=[ao.ground(BALL)], **options)
    exact = (1 + vertex_normals(BALL.vertices, BALL.faces)[:, 1]) / 2
    assert np.sqrt(np.mean((baked.w - exact) ** 2)) < 0.011
    assert baked.interpolation.rmse < 0.02  # by 256 points, of which each errs by some .2
    assert 0 < baked.rmse < 0.01


def test_w_is_that_of_all_in_one_mesh():
    near = Mesh(*icosphere(1))
    moved = Mesh(0.4 * near.vertices + (0.9, 0.7, 0.0), near.faces)
    glass = Opacity.uniform(AlphaSurface(0.5), near.faces)
    hollow = Mesh(0.5 * near.vertices - (0.9, 0.7, 0.0), near.faces, opacity=glass)
    whole = join((each.vertices, each.faces) for each in (BALL, moved, hollow))
    opacity = Opacity.joined([None, None, hollow.opacity], [len(each.faces) for each in (BALL, moved, hollow)])
    radius = {"half_distance": 0.5 * BALL.radius}
    alike = ao.bake(Mesh(*whole, opacity=opacity), ao.Exponential(**radius), 64, denoise=False)
    baked = ao.bake(BALL, ao.Exponential(half_distance="50%"), 64, denoise=False, occluders=[moved, hollow])
    assert np.array_equal(baked.w, alike.w[: len(BALL.vertices)])
    assert np.array_equal(baked.flags, alike.flags[: len(BALL.vertices)])
    assert baked.flagged["hidden"] > 0
    assert baked.mesh is BALL
    assert baked.rays_skipped.keys() == alike.rays_skipped.keys()
    only = np.arange(len(BALL.vertices)) % 3 == 0
    some = ao.bake(BALL, ao.Exponential(**radius), 64, denoise=False, occluders=[moved, hollow], only=only)
    seen = only & (baked.flags & ao.Flag.HIDDEN == 0)
    assert np.array_equal(some.w[seen], baked.w[seen])
    assert (some.w[~only] == 1).all()


def test_a_prepared_mesh_is_placed_anew():
    floor = ao.ground(BALL)
    assert np.array_equal(
        ao.bake(ao.prepare(BALL), samples=16, occluders=[floor]).w, ao.bake(BALL, samples=16, occluders=[floor]).w
    )


def test_textures():
    """Of two faces that look down at a disc's worth of ground."""
    table = Mesh([(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], [[0, 1, 2], [0, 2, 3]])
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float64)
    options = {"size": 16, "falloff": ao.Exponential(half_distance=0.5), "samples": 256, "close_seams": False}
    over = ao.bake_texture(table, uv, occluders=[ao.ground(table, -0.3)], **options)
    exact = over_ground(np.array([-UP]), np.array([0.3]), lambda d: -np.expm1(-np.log(2) / 0.5 * d))
    assert np.abs(over.w - exact).max() < 0.01
    assert over.uv.shape == (2, 3, 2)
    assert (ao.bake_texture(table, uv, **options).w == 1).all()


@pytest.mark.parametrize(("up", "axis"), [("x", 0), ("-y", 1), ("z", 2), ("-z", 2), (None, 2)])
def test_the_ground_is_below(up, axis):
    mesh = Mesh(BALL.vertices + np.array([3.0, 4.0, 5.0]), BALL.faces, up="z")
    plane, sign = ao.ground(mesh, up=up), -1 if up and up[0] == "-" else 1
    lowest = (sign * mesh.vertices[:, axis]).min()
    assert np.ptp(plane.vertices[:, axis]) == 0
    assert lowest - 1e-3 < sign * plane.vertices[0, axis] < lowest
    a, b, c = plane.vertices[plane.faces[0]]
    assert sign * np.cross(b - a, c - a)[axis] > 0
    assert (np.sort(np.ptp(plane.vertices, axis=0))[1:] > 2000).all()


@pytest.mark.parametrize("height", [0.0, float("nan"), -np.inf, "low"])
def test_a_ground_through_the_mesh_is_refused(height):
    with pytest.raises(OptionError, match="ground: expected a height up to -1, that of the lowest vertex"):
        ao.ground(BALL, height)


def test_what_is_no_occluder_is_refused():
    with pytest.raises(MeshError, match="occluders"):
        ao.bake(BALL, occluders=["floor.ply"])
    with pytest.raises(ConflictError, match="occluders does not go with high"):
        ao.bake(hills(5), high=hills(9), occluders=[BALL])
    with pytest.raises(OptionError, match=r"only: expected bool \(642,\)"):
        ao.bake(BALL, only=np.ones(646, bool), occluders=[ao.ground(BALL)])
