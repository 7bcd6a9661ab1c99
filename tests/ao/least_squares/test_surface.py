"""Baking from samples of the surface: what it must reproduce, what it is for, and what it says of itself."""

from functools import partial

import numpy as np
import pytest
import trimesh
from meshes import grid, hills, turned
from scipy.spatial.transform import Rotation

from benchmarks.accuracy.surface_error import Points
from obscurance import ao
from obscurance.raytrace import Mesh, OptionError
from obscurance.scenes.geometry.polyhedra import icosphere, join
from obscurance.scenes.validation import table as validation

bake_surface = partial(ao.bake, method="surface")


def block(centre, extents, turn=0.0):
    box = trimesh.creation.box(extents)
    return box.vertices @ Rotation.from_euler("z", turn).as_matrix().T + centre, np.asarray(box.faces)


def buried():
    """A low post that stands in a coarse ground, over its middle vertex."""
    return Mesh(*join([grid(4, 4.0), block([0, 0, 0.05], [0.3, 0.3, 0.5], 0.3)]))


CLOSED = [line for line in validation.configurations() if line.name.startswith(("closed", "inside a sphere"))]


@pytest.mark.parametrize("line", [line for line in CLOSED if line.falloff == ao.Binary()], ids=lambda line: line.name)
def test_what_is_closed_all_around_is_closed(line):
    assert np.abs(validation.measure(line, bake_surface, samples=64)).max() <= 1e-6


def test_the_floor_under_a_sphere_follows_its_closed_form_between_the_vertices():
    """1 − R²H/(r²+H²)^(3/2) on the plane: the fit is nearer to it, over the faces, than w at the vertices is."""
    radius, height = 0.3, 0.45
    plane = grid(8, 2.0)
    ball = icosphere(4)
    mesh = Mesh(*join([plane, (ball[0] * radius + [0, 0, height], ball[1])]))
    rng = np.random.default_rng(0)
    face = plane[1][rng.integers(0, len(plane[1]), 20_000)]
    b = rng.dirichlet([1, 1, 1], len(face))
    r2 = (np.einsum("kc,kci->ki", b, plane[0][face])[:, :2] ** 2).sum(axis=1)
    exact = 1 - radius**2 * height / (r2 + height**2) ** 1.5
    vertex, surface = (
        np.sqrt(np.mean((np.einsum("kc,kc->k", b, bake(mesh, ao.Binary(), samples=1024).w[face]) - exact) ** 2))
        for bake in (ao.bake, bake_surface)
    )
    assert surface < 0.7 * vertex
    assert surface < 0.01


def test_a_buried_vertex_does_not_darken_what_is_in_sight():
    mesh = buried()
    points = Points(mesh, 8_000, 128)
    points.hidden |= points.corners[:, 0] >= 25  # the ground
    vertex, surface = ao.bake(mesh, samples=256, interior="ignore"), bake_surface(mesh, samples=256)
    centre = 12
    assert vertex.w[centre] < 0.5
    assert surface.w[centre] > 0.75
    before, after = (points.errors(baked.w, "exponential")["shading"] for baked in (vertex, surface))
    assert after < 0.4 * before


def test_rooms_whose_walls_face_outwards_are_baked_all_the_same():
    """All samples inside see backs only; none may be left out, or nothing would be known."""
    shell = block([0, 0, 0], [4, 4, 4])
    inside = join([shell, (grid(8, 2.0)[0] + [0, 0, -1], grid(8, 2.0)[1]), block([0.1, 0.2, -0.7], [0.5, 0.5, 0.8])])
    baked, vertex = (bake(Mesh(*inside), samples=2048) for bake in (bake_surface, ao.bake))
    floor = slice(8, 8 + 81)
    far = np.abs(inside[0][floor, :2] - [0.1, 0.2]).max(axis=1) > 0.6
    difference = (baked.w - vertex.w)[floor][far]
    assert np.sqrt(np.mean(difference**2)) < 0.015


def test_hard_edges_keep_values_of_their_own():
    """A step: the tread by the riser is dark, the riser's own top edge is not; stored apart, they stay apart."""
    tread = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0.0]])
    riser = np.array([[0, 0, 0], [0, 2, 0], [0, 2, 1], [0, 0, 1.0]])
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    baked = bake_surface(Mesh(*join([(tread, quad), (riser * [1, 1, 0.2], quad)])), ao.Binary(), samples=1024)
    assert baked.w[0] < 0.85
    assert baked.w[4] == pytest.approx(0.5, abs=0.1)
    assert abs(baked.w[0] - baked.w[4]) > 0.05


def slabs(boxes):
    """Boxes from `low` to `high`, of 8 vertices each."""
    solids = [trimesh.creation.box(bounds=bounds) for bounds in boxes]
    return Mesh(*join([(solid.vertices, np.asarray(solid.faces)) for solid in solids]))


def table(rng):
    """A table of 48 vertices: a top, four legs a little below it, and a slab of ground; of random sizes."""
    length, width, height = rng.uniform(0.6, 1.2, 3)
    legs = [(x * (length - 0.1), y * (width - 0.1)) for x in (-1, 1) for y in (-1, 1)]
    boxes = [([-length, -width, height], [length, width, height + 0.08]), ([-2, -2, -0.1], [2, 2, 0])]
    return boxes + [([x - 0.05, y - 0.05, 0.01], [x + 0.05, y + 0.05, height - 0.01]) for x, y in legs]


@pytest.mark.parametrize("seed", range(2))
def test_coarse_meshes_are_fitted_to_a_tolerance(seed):
    mesh = slabs(table(np.random.default_rng(seed)))
    dense = bake_surface(mesh, samples=1 << 18, seed=99).w
    rays = []
    for options in ({"tolerance": 0.01}, {}):
        bakes = [bake_surface(mesh, **options, seed=seed + turn) for turn in range(2)]
        true = np.sqrt(np.mean([(baked.w - dense) ** 2 for baked in bakes]))
        reported = np.sqrt(np.mean([baked.rmse**2 for baked in bakes]))
        tolerance = options.get("tolerance", 0.005)
        assert true < 1.1 * tolerance
        assert true / 1.3 < reported <= tolerance
        rays.append(bakes[0].rays)
    assert rays[0] < rays[1]


@pytest.mark.parametrize("seed", range(6))
def test_equal_corners_are_equal(seed):
    """A rectangle below the middle of another, which darkens one of its diagonals no more than the other."""
    rng = np.random.default_rng(seed)
    floor = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * rng.uniform(0.5, 2, 3)
    plate = floor[::-1] * rng.uniform(0.3, 1.2) + [0, 0, rng.uniform(0.2, 1)]
    quads = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = Mesh(*turned(join([(floor, quads), (plate, quads)])))
    baked = bake_surface(mesh, ao.Binary(), tolerance=0.005, seed=seed)
    assert baked.rmse <= 0.005
    assert np.ptp(baked.w[:4]) < 4 * baked.rmse + 2e-4
    assert 0.1 < baked.w[0] < 0.999


def test_the_floor_of_one_square_follows_the_fit_to_its_closed_form():
    """Under a sphere, 1 − R²H/(r²+H²)^(3/2): a dense fit over both cuts of the square, by hand."""
    radius, height = 0.4, 0.6
    ball, square = icosphere(3), np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    places = np.stack(np.meshgrid(*[(np.arange(400) + 0.5) / 200 - 1] * 2), axis=-1).reshape(-1, 2)
    exact = 1 - radius**2 * height / ((places**2).sum(axis=1) + height**2) ** 1.5
    u, v = (places.T + 1) / 2
    low, high, over = np.minimum(u, v), np.maximum(u, v), np.maximum(u + v - 1, 0)
    cut = np.stack([1 - high, np.maximum(u - v, 0), low, np.maximum(v - u, 0)], axis=1)
    other = np.stack([np.maximum(1 - u - v, 0), u - over, over, v - over], axis=1)
    fit = np.linalg.lstsq(np.concatenate([cut, other]), np.concatenate([exact, exact]), rcond=None)[0]
    mesh = Mesh(*join([(square, np.array([[0, 1, 2], [0, 2, 3]])), (ball[0] * radius + [0, 0, height], ball[1])]))
    baked = bake_surface(mesh, ao.Binary(), tolerance=0.004)
    np.testing.assert_allclose(baked.w[:4], np.minimum(fit, 1), atol=0.012)


def test_a_tolerance_that_the_rays_do_not_reach_is_reported():
    with pytest.warns(ao.ToleranceWarning, match="tolerance 0.001 is not met.*: 32 rays a vertex were allowed"):
        baked = bake_surface(Mesh(*hills(20)), tolerance=0.001, samples=32)
    assert baked.rmse > 0.001


def test_coincident_vertices_of_a_smooth_surface_share_a_value():
    sphere = trimesh.creation.icosphere(subdivisions=2)
    soup = Mesh(sphere.triangles.reshape(-1, 3), np.arange(3 * len(sphere.faces)).reshape(-1, 3)[:, ::-1])
    baked = bake_surface(soup, samples=16)
    assert len(np.unique(baked.w)) <= len(sphere.vertices)
    assert baked.rays_skipped["duplicate"] == 16 * (len(soup.vertices) - len(sphere.vertices))


@pytest.mark.parametrize("samples", [1, 8, 100, 256])
def test_it_spends_no_more_rays_than_the_vertex_method(samples):
    calls = []
    mesh = Mesh(*hills(20))
    baked = bake_surface(mesh, samples=samples, progress=lambda done, total, stage: calls.append((done, total)))
    total = baked.rays + baked.rays_skipped["below_face"]
    assert samples * 400 - 32 < total <= samples * 400
    assert (total, total) in calls
    assert ((baked.w >= 0) & (baked.w <= 1)).all()


def test_some_stretches_of_a_large_mesh_show_how_smooth_it_is(monkeypatch, watch):
    mesh = Mesh(*hills(70))
    tried = watch("obscurance.ao.least_squares.fit.cross_validated")
    whole = bake_surface(mesh, samples=64, seed=1)  # of one seed in six the part finds another smoothness
    monkeypatch.setattr("obscurance.ao.least_squares.fit._RUN", 128)
    part = bake_surface(mesh, samples=64, seed=1)
    assert [len(problem.stencil.face_points) for problem, _ in tried] == [len(mesh.faces), 32 * 128]
    assert np.sqrt(np.mean((part.w - whole.w) ** 2)) < 0.25 * whole.rmse
    assert part.rmse == pytest.approx(whole.rmse, rel=0.1)


def sunk():
    """A ball that is sunk into a floor, and which of their vertices are in sight."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    mesh = Mesh(*join([grid(23, 4.0), (ball.vertices - [0, 0, 0.7], np.asarray(ball.faces))]))
    x, y, z = mesh.vertices.T
    on_floor = np.arange(len(z)) < 24**2
    return mesh, ~np.where(on_floor, x**2 + y**2 < 1 - 0.7**2, z < 0)


def test_several_falloffs_are_each_fitted_as_alone():
    """The same rays and points, but the smoothing that suits the first."""
    mesh = Mesh(*hills(20))
    falloffs = [ao.Binary(), ao.Exponential(tau=2.0), ao.Exponential(tau=1.0), ao.Binary(max_distance=0.3)]
    together = bake_surface(mesh, falloffs, samples=1024)
    dense = bake_surface(mesh, falloffs, samples=1 << 14, seed=9).values
    assert together.values.shape == (len(mesh.vertices), len(falloffs))
    assert len(together.rmses) == len(falloffs)
    for column, falloff in enumerate(falloffs):
        alone = bake_surface(mesh, falloff, samples=1024)
        assert together.rays == alone.rays
        off = np.sqrt(np.mean((together.values[:, column] - alone.w) ** 2))
        assert off < (1e-6 if column == 0 else alone.rmse)
        true = np.sqrt(np.mean((together.values[:, column] - dense[:, column]) ** 2))
        assert true / 1.35 < together.rmses[column] < 1.35 * true


def test_a_profile_of_a_sphere_follows_its_closed_form():
    """1 − 2[1 − (1+a)e^(−a)]/a², a = 2τR, at each half-distance."""
    vertices, faces = icosphere(3)
    baked = bake_surface(Mesh(vertices, faces[:, ::-1]), profile=True, tolerance=0.01)
    a = 2 * np.log(2) / baked.profile.half_distances
    exact = 1 - 2 * (1 - (1 + a) * np.exp(-a)) / a**2
    assert np.ptp(exact) > 0.6
    np.testing.assert_allclose(baked.profile.values, np.broadcast_to(exact, (len(vertices), 10)), atol=0.01)
    assert max(baked.rmses) <= 0.01


def test_interior_says_what_buried_vertices_get():
    mesh, centre = buried(), 12
    auto, ignored, marked, filled = (
        bake_surface(mesh, ao.Binary(), samples=1024, interior=each) for each in ("auto", "ignore", "mark", "fill")
    )
    assert ignored.w[centre] < auto.w[centre] - 0.1
    np.testing.assert_array_equal(marked.w, auto.w)
    assert filled.w[centre] == pytest.approx(auto.w[centre], abs=0.01)
    assert not marked.flags.any()  # samples around each are in sight


def test_faces_that_nobody_sees_are_filled_from_visible_ones_or_flagged():
    mesh, in_sight = sunk()
    auto, marked, filled = (
        bake_surface(mesh, ao.Binary(), samples=256, interior=each) for each in ("auto", "mark", "fill")
    )
    floor = np.arange(len(in_sight)) < 24**2
    deep = floor & (np.hypot(*mesh.vertices[:, :2].T) < 0.4)
    hidden = marked.flags & ao.Flag.HIDDEN > 0
    assert hidden[deep].all()
    assert not hidden[in_sight].any()
    assert np.array_equal(filled.flags, marked.flags)
    np.testing.assert_array_equal(marked.w, auto.w)
    assert (auto.w[deep] < 0.01).all()  # inside the ball
    rim = floor & in_sight & (np.hypot(*mesh.vertices[:, :2].T) < 0.9)
    assert (filled.w[deep] > filled.w[rim].min() - 0.3).all()
    np.testing.assert_allclose(filled.w[in_sight], auto.w[in_sight], atol=0.1)


def test_a_room_is_not_filled_where_nothing_is_seen():
    shell = block([0, 0, 0], [2, 2, 2])
    ball = icosphere(2)
    mesh = Mesh(*join([shell, (0.3 * ball[0], ball[1])]))
    w = [bake_surface(mesh, samples=256, interior=each).w for each in ("auto", "fill")]
    np.testing.assert_allclose(*w, atol=1e-6)


def test_bent_normals_lean_away_from_a_wall_and_stand_up_on_an_open_plane():
    wall = np.array([[1.0, -5, 0], [1, 5, 0], [1, 5, 5], [1, -5, 5]])
    mesh = Mesh(*join([grid(4, 2.0), (wall, np.array([[0, 1, 2], [0, 2, 3]]))]))
    bent = bake_surface(mesh, ao.Binary(), samples=1024).bent_normals
    np.testing.assert_allclose(np.linalg.norm(bent, axis=1), 1)
    assert bent[12, 0] < -0.1
    assert abs(bent[12, 1]) < 0.05
    plane = bake_surface(Mesh(*grid(3, 2.0)), samples=4096).bent_normals
    np.testing.assert_allclose(plane, [[0, 0, 1]] * 16, atol=5e-3)


def test_some_of_the_vertices():
    mesh = Mesh(*hills(24))
    wanted = np.arange(576) < 60
    whole, part = (bake_surface(mesh, samples=256, only=only) for only in (None, wanted))
    np.testing.assert_allclose(part.w[wanted], whole.w[wanted], atol=0.1)
    assert np.sqrt(np.mean((part.w - whole.w)[wanted] ** 2)) < 0.03
    assert (part.w[~wanted] == 1).all()
    assert part.rays < 0.2 * whole.rays
    with pytest.raises(OptionError, match="only: expected bool"):
        bake_surface(mesh, only=wanted[:-1])


def test_turned_moved_and_scaled_it_is_the_same_but_for_its_noise():
    vertices, faces = hills(16)
    moved = Rotation.from_euler("xyz", [1, 2, 3]).apply(vertices) * 1024 + 1e5
    here, there = (bake_surface(Mesh(v, faces), samples=2048).w for v in (vertices, moved))
    assert np.sqrt(np.mean((here - there) ** 2)) < 0.012
