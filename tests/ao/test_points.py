"""`ao.bake_points`: points beside a mesh, and clouds of points."""

import numpy as np
import pytest
from meshes import hills

from obscurance import ao
from obscurance.ao import closed_forms
from obscurance.ao.points.discs import discs
from obscurance.raytrace import Mesh, MeshError, OptionError

WALL = [[0, -60, 0], [0, 60, 0], [0, 60, 60], [0, -60, 60]], [[0, 1, 2], [0, 2, 3]]


def along_floor(count=60):
    x = np.linspace(0.2, 3, count)
    return np.stack([x, 0 * x, 0 * x], axis=1), np.tile([0, 0, 7.0], (count, 1))


@pytest.mark.parametrize("options", [{"samples": 2500}, {"samples": 2500, "denoise": False}, {"tolerance": 0.005}])
def test_points_in_space_beside_a_wall(options):
    points, normals = along_floor()
    baked = ao.bake_points(WALL, points, normals, falloff=ao.Exponential(tau=1.0), **options)
    exact = np.array([closed_forms.wall(x, tau=1.0) for x in points[:, 0]])
    assert np.sqrt(np.mean((baked.w - exact) ** 2)) < 0.008
    assert baked.at == "points"
    assert (baked.bent_normals[:10, 0] > 0.1).all()
    assert not baked.flags.any()


@pytest.mark.parametrize("gap", [1e-2, 1e-4])
def test_what_is_far_away_does_not_move_points_through_what_is_near(gap):
    sheet = Mesh([[-1, -1, gap], [1, -1, gap], [1, 1, gap], [-1, 1, gap]], [[0, 1, 2], [0, 2, 3]])
    far = ao.ground(sheet, -1000.0)
    baked = ao.bake_points(sheet, [[0, 0, 0.0]], [[0, 0, 1.0]], falloff="binary", samples=64, occluders=[far])
    assert baked.w[0] == pytest.approx(0, abs=gap)


def test_points_on_a_mesh_have_w_of_its_vertices():
    mesh = Mesh(*hills(40))
    prepared = ao.prepare(mesh)
    normals = np.zeros_like(mesh.vertices)
    np.add.at(normals, mesh.faces, _angle_weighted(mesh))
    vertices = ao.bake(prepared, ao.Binary(), samples=1024)
    points = ao.bake_points(prepared, mesh.vertices, normals, falloff=ao.Binary(), samples=1024)
    ordinary = vertices.flags == 0
    assert np.sqrt(np.mean((vertices.w - points.w)[ordinary] ** 2)) < 0.006


def _angle_weighted(mesh):
    corners = mesh.vertices[mesh.faces]
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    size = np.linalg.norm(ahead, axis=2) * np.linalg.norm(behind, axis=2)
    angles = np.arccos(np.clip(np.einsum("fcd,fcd->fc", ahead, behind) / size, -1, 1))
    normals = np.cross(ahead[:, 0], behind[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return angles[..., None] * normals[:, None]


def test_clouds_of_a_plane_and_a_ball_are_open_outside_and_closed_inside():
    random = np.random.default_rng(2)
    plane = np.append(random.uniform(-1, 1, (3000, 2)), np.zeros((3000, 1)), axis=1)
    for side in (-1.0, 1.0):
        assert (
            ao.bake_points(None, plane, np.tile([0, 0, side], (3000, 1)), falloff="binary", samples=64).w == 1
        ).all()
    ball = random.normal(size=(4000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    assert (ao.bake_points(None, ball, ball, falloff="binary", samples=64).w > 0.995).all()
    assert np.mean(ao.bake_points(None, ball, -ball, falloff="binary", samples=64).w) < 0.01
    walled = ao.bake_points(None, ball + np.array([3, 0, 0]), ball, falloff="binary", samples=64, occluders=[WALL])
    assert walled.w[ball[:, 0] < -0.9].mean() < 0.6


def test_points_without_a_normal_and_what_is_refused():
    points, normals = along_floor(5)
    normals[2] = 0
    normals[3] = np.nan
    baked = ao.bake_points(WALL, points, normals, samples=16)
    assert (baked.w[2:4] == 1).all()
    assert baked.flags.tolist() == [0, 0, ao.Flag.DEGENERATE, ao.Flag.DEGENERATE, 0]
    with pytest.raises(OptionError, match="shape"):
        ao.bake_points(WALL, points, normals[:4])
    with pytest.raises(OptionError, match="shape"):
        ao.bake_points(WALL, points[0], normals)
    with pytest.raises(MeshError, match="finite"):
        ao.bake_points(WALL, points + np.inf, normals)
    with pytest.raises(MeshError, match="at least two"):
        ao.bake_points(None, points[:1], normals[:1])
    with pytest.raises(OptionError, match="interior: expected one of"):
        ao.bake_points(WALL, points, normals, interior="mark")


def scattered(random, count, is_grid):
    """Places (count², 2) in a square of side 1."""
    if is_grid:
        steps = (np.arange(count) + 0.5) / count
        return np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    return random.uniform(0, 1, (count**2, 2))


NEAR = ao.Binary(max_distance=0.3)  # within which no end of a square shows


def reported_and_true(cloud, seeds=2):
    """The root mean squares of reported and of true errors at the points of several clouds, each of which `cloud` makes
    of a seed: points, normals, which of them count, and w of these."""
    reported, true = [], []
    for seed in range(seeds):
        points, normals, rows, exact = cloud(np.random.default_rng(seed))
        baked = ao.bake_points(None, points, normals, falloff=NEAR, samples=64, seed=seed)
        reported.append(baked.error[rows])
        true.append(baked.w[rows] - exact)
    return tuple(float(np.sqrt(np.mean(np.concatenate(errors) ** 2))) for errors in (reported, true))


@pytest.mark.parametrize("is_grid", [True, False])
@pytest.mark.parametrize("angle", [15, 120])
def test_clouds_are_closed_in_creases(angle, is_grid):
    """Two squares that meet at an angle, along whose edge (1 − cos α)/2 is open, but for what is farther than .3."""
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    corners = [(0, -1, 0), (2, -1, 0), (2, 2, 0), (0, 2, 0), (2 * cosine, -1, 2 * sine), (2 * cosine, 2, 2 * sine)]
    mesh = Mesh(corners, [[0, 1, 2], [0, 2, 3], [0, 3, 5], [0, 5, 4]])

    def crease(random):
        floor, wall = (scattered(random, 50, is_grid) for _ in range(2))
        points = np.zeros((2, 2500, 3))
        points[0, :, :2] = floor
        points[1] = np.stack([wall[:, 0] * cosine, wall[:, 1], wall[:, 0] * sine], axis=1)
        normals = np.repeat([[(0, 0, 1)], [(sine, 0, -cosine)]], 2500, axis=1)
        near = np.flatnonzero((floor[:, 0] < 0.15) & (np.abs(floor[:, 1] - 0.5) < 0.15))
        exact = ao.bake_points(mesh, points[0, near], normals[0, near], falloff=NEAR, samples=1024).w
        at_edge = floor[near, 0] < 0.02
        assert exact[at_edge].mean() == pytest.approx((1 - cosine) / 2, abs=0.03)
        return points.reshape(-1, 3), normals.reshape(-1, 3), near, exact

    reported, true = reported_and_true(crease)
    assert true < 1.3 * reported + 0.005  # and half a spacing between discs of both squares, which no error holds
    assert reported < 1.3 * true + 0.015  # a few points at random seem to lie at a border


@pytest.mark.parametrize("is_grid", [True, False])
@pytest.mark.parametrize("facing", [-1.0, 1.0])
@pytest.mark.parametrize("height", [0.05, 0.8])
def test_sheets_of_clouds_lie_over_one_another(height, facing, is_grid):
    """Heights in spacings of the points; what lies below the upper sheet sees out beyond .3 alone, as do two that face
    each other."""

    def sheets(random):
        places = np.concatenate([scattered(random, 40, is_grid) for _ in range(2)])
        is_upper = np.arange(3200) >= 1600
        points = np.column_stack([places, is_upper * height / 40])
        normals = np.where(is_upper[:, None], [0, 0, facing], [0, 0, 1.0])
        inner = (np.abs(places - 0.5) < 0.35).all(axis=1)
        between = (height / 40 / 0.3) ** 2
        return points, normals, inner, np.where(is_upper, 1.0 if facing > 0 else between, between)[inner]

    reported, true = reported_and_true(sheets)
    assert true < (0.006 if is_grid else 0.05)  # points at random leave holes
    assert true < (1.3 if height > 0.1 else 2.0) * reported + 0.001
    assert reported < 1.3 * true + 0.01


@pytest.mark.parametrize("is_grid", [True, False])
@pytest.mark.parametrize("noise", [0.02, 0.1, 0.3])
def test_rough_clouds_say_by_how_much_they_may_be_closed(noise, is_grid):
    """A plane whose points are off it at random, by a part of their spacing."""

    def rough(random):
        points = np.column_stack([scattered(random, 50, is_grid), noise / 50 * random.normal(size=2500)])
        return points, np.tile([0, 0, 1.0], (2500, 1)), slice(None), 1.0

    reported, true = reported_and_true(rough, seeds=3)
    assert true < (0.05 if noise < 0.2 else 0.5)
    assert true < 1.3 * reported + 0.01  # few are closed where noise is just more than what is level
    assert reported < 1.3 * true + 0.03
    points, normals, _, _ = rough(np.random.default_rng(9))
    assert not ao.bake_points(None, points, normals, falloff="binary", tolerance=0.6).shortfalls


@pytest.mark.parametrize("is_grid", [True, False])
def test_discs_end_at_convex_edges(is_grid):
    """A box of any size and orientation is open all over."""
    for seed in range(4):
        random = np.random.default_rng(seed)
        size, turn = random.uniform(0.5, 1.5, 3), np.linalg.qr(random.normal(size=(3, 3)))[0]
        points, normals = [], []
        for axis, side in np.ndindex(3, 2):
            face = scattered(random, 20, is_grid)
            points.append(np.insert(face, axis, side, axis=1) * size @ turn)
            normals.append(np.tile((2 * side - 1) * turn[axis], (400, 1)))
        baked = ao.bake_points(None, np.concatenate(points), np.concatenate(normals), falloff="binary", samples=64)
        assert np.mean(baked.w < 0.99) < 0.01
        assert np.sqrt(np.mean((baked.w - 1) ** 2)) < 0.01


@pytest.mark.parametrize("is_grid", [True, False])
@pytest.mark.parametrize("height", [2, 4])
def test_discs_end_at_borders_of_sheets(height, is_grid):
    """A floor below half a sheet, heights in spacings of the points, against the mesh of both."""
    upper = [(0, 0), (0.5, 0), (0.5, 1), (0, 1)]
    mesh = Mesh([(x, y, height / 40) for x, y in upper], [[0, 1, 2], [0, 2, 3]])

    def shelf(random):
        floor, sheet = scattered(random, 40, is_grid), scattered(random, 40, is_grid)
        sheet = (sheet + random.uniform(0, 1, 2) / 40) % 1  # so that the border is at any place between points
        sheet = sheet[sheet[:, 0] < 0.5]
        points = np.concatenate([np.insert(floor, 2, 0, axis=1), np.insert(sheet, 2, height / 40, axis=1)])
        below = np.flatnonzero((np.abs(floor[:, 0] - 0.5) < 0.1) & (np.abs(floor[:, 1] - 0.5) < 0.2))
        normals = np.tile([0, 0, 1.0], (len(points), 1))
        exact = ao.bake_points(mesh, points[below], normals[below], falloff=NEAR, samples=1024).w
        return points, normals, below, exact

    reported, true = reported_and_true(shelf, seeds=3)
    assert true < 0.4 / height  # .19 and .12 for discs that reach beyond
    assert true < 1.3 * reported + 0.01


def test_a_cloud_in_doubt_misses_its_tolerance_and_says_why():
    random = np.random.default_rng(5)
    points = np.append(random.uniform(0, 1, (2500, 2)), 0.006 * random.normal(size=(2500, 1)), axis=1)
    with pytest.warns(ao.ToleranceWarning):
        baked = ao.bake_points(None, points, np.tile([0, 0, 1.0], (2500, 1)), falloff="binary", tolerance=0.01)
    assert "tolerance 0.01 is not met" in baked.shortfalls[0]
    assert "of 2,500 points, or beside: noise, holes of a sheet, or its border" in baked.shortfalls[1]


def test_the_disc_of_a_point_with_another_normal_than_all_around_is_no_larger():
    places = scattered(np.random.default_rng(6), 40, True)
    points, normals = np.append(places, np.zeros((1600, 1)), axis=1), np.tile([0, 0, 1.0], (1600, 1))
    normals[820] *= -1
    lifts = discs(points, normals).lifts  # half of the radii
    assert lifts[820] == pytest.approx(lifts[700], rel=0.01)
