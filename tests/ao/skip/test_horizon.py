"""Rays that certainly meet nothing: leaving them out changes no bit, and horizons lie where geometry stands."""

import numpy as np
import pytest
from meshes import MESHES, hills

import ao
import ao.skip.horizon
from ao.gather.directions import SECTORS, DirectionTable, choose, turned_frame
from ao.gather.receivers import find_receivers
from ao.skip.bvh16 import BVH16
from ao.skip.horizon import Horizons
from ao.trace.checkpoint import Checkpoint
from raytrace import Mesh
from raytrace.mesh.placement import Placement
from scenes.geometry.polyhedra import icosphere
from scenes.geometry.primitives import box
from scenes.geometry.temple import temple

FALLOFFS = {
    "binary": ao.Binary(),
    "binary, limited": ao.Binary(0.5),
    "exponential": ao.Exponential(tau=1.5),
    "exponential, limited": ao.Exponential(tau=1.5, max_distance=0.5),
}


@pytest.fixture
def always(monkeypatch):
    """Horizons are right where they don't pay, too."""
    monkeypatch.setattr(Horizons, "pay", lambda self, points, table: True)


def bits(baked):
    return baked.w.tobytes(), baked.error.tobytes(), baked.bent_normals.tobytes(), baked.flags.tobytes()


def check_same(mesh, falloff, samples=300, **options):
    """The bake with skipping, after comparing it with one without."""
    whole, less = (ao.bake(mesh, falloff, samples, skip=skip, **options) for skip in (False, True))
    assert bits(less) == bits(whole)
    assert less.rays + less.rays_skipped["open"] == whole.rays
    assert whole.rays_skipped["open"] == 0
    return less


@pytest.mark.parametrize("falloff", FALLOFFS)
@pytest.mark.parametrize("name", MESHES)
def test_skipping_changes_no_bit(name, falloff, always):
    assert check_same(Mesh(*MESHES[name]), FALLOFFS[falloff]).rays_skipped["open"] > 0


@pytest.mark.parametrize("falloff", FALLOFFS)
def test_nor_on_a_mesh_with_hard_edges_and_contacts(falloff, always):
    assert check_same(temple(0.6), FALLOFFS[falloff], 100).rays_skipped["open"] > 0


@pytest.mark.parametrize("samples", [1, 7, 64, 2500])
def test_nor_with_any_number_of_rays(samples, always):
    check_same(Mesh(*hills()), ao.Exponential(), samples)


def test_nor_with_a_tolerance(always):
    check_same(Mesh(*hills(40)), ao.Binary(), None, tolerance=0.01)


def nasty(seed):
    """Triangles of all sizes and shapes, slivers and needles among them, some of them sharing corners or planes."""
    chance = np.random.default_rng(seed)
    count = 40
    corners = chance.normal(size=(count, 1, 3)) + chance.normal(size=(count, 3, 3)) * 10 ** chance.uniform(
        -4, 0.5, (count, 1, 1)
    )
    corners[:10, 2] = corners[:10, 1] + 1e-6 * chance.normal(size=(10, 3))
    corners[10:20, 2] = (corners[10:20, 0] + corners[10:20, 1]) / 2 + 1e-5 * chance.normal(size=(10, 3))
    corners[20:25, :, 2] = 0.25
    corners[25:30, 0] = corners[20:25, 0]
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


@pytest.mark.parametrize("seed", range(12))
def test_nor_among_slivers_and_needles_of_all_sizes(seed, always):
    falloff = list(FALLOFFS.values())[seed % 4]
    check_same(nasty(seed), falloff, 1000, seed=seed)


@pytest.mark.parametrize(("scale", "shift"), [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e5)])
def test_nor_at_any_size_and_place(scale, shift, always):
    vertices, faces = MESHES["soup"]
    check_same(Mesh(vertices * scale + shift, faces), ao.Binary())


def test_a_horizon_too_low_would_be_seen(monkeypatch, always):
    exact = Horizons.above
    monkeypatch.setattr(Horizons, "above", lambda self, points, table: 0.8 * exact(self, points, table))
    whole, less = (ao.bake(Mesh(*hills()), ao.Binary(), 1000, skip=skip) for skip in (False, True))
    assert bits(less) != bits(whole)


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("reach", [np.inf, 0.6])
def test_horizons_stand_over_everything_and_not_far_over(name, reach):
    mesh = Mesh(*MESHES[name])
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement)
    points = receivers.points
    table = DirectionTable.make(4096, len(points), np.uint32(7))
    slopes = Horizons(placement, receivers, ao.Binary(reach).resolve(mesh.radius)).above(points, table)
    chance = np.random.default_rng(1)
    weights = chance.dirichlet(np.full(3, 0.6), 3_000)[:, None, :, None]
    corners = placement.vertices[receivers.faces].astype(np.float64)
    places = (corners * weights).sum(axis=2).reshape(-1, 3)  # all over the triangles, most by their edges
    over, beyond = 0.0, 0.0
    for i in range(len(points)):
        normal = points.normals[i]
        _, turn = choose(points.numbers[i], table.key, len(table.directions))
        t, b = turned_frame(tuple(normal), turn)
        away = places - points.origins[i]
        if reach < np.inf:
            away = away[np.linalg.norm(away, axis=1) < reach * placement.scale]
        x, y, z = (away @ np.array(axis, np.float64) for axis in (t, b, normal))
        slope, sector = z / np.hypot(x, y), (np.arctan2(y, x) / (2 * np.pi) % 1 * SECTORS).astype(int) % SECTORS
        seen = np.zeros(SECTORS)
        np.maximum.at(seen, sector, slope)
        assert (slopes[i] >= seen).all()
        over += np.mean(seen**2 / (1 + seen**2))
        beyond += np.mean(np.where(np.isinf(slopes[i]), 1, slopes[i] ** 2 / (1 + np.minimum(slopes[i], 1e9) ** 2)))
    assert beyond / len(points) < over / len(points) + 0.2  # shares of the rays, so that most that are open are found


def test_next_to_nothing_is_traced_over_a_convex_body(always):
    baked = check_same(Mesh(*icosphere(3)), ao.Binary(), 256)
    assert baked.rays < 1e-4 * baked.rays_skipped["open"]
    assert (baked.w == 1).all()


def test_what_is_too_far_to_count_has_no_part(always):
    near, far = box((0, 0, 0), (1, 1, 1), 0.25).mesh, box((0, 0, 0.6 + 0.5), (1, 1, 1), 0.25).mesh
    both = Mesh(
        np.vstack([near.vertices, far.vertices]), np.vstack([near.faces, far.faces + len(near.vertices)])
    )  # a gap of .1 between them
    assert check_same(both, ao.Binary(0.09), 256).rays == 0
    assert check_same(both, ao.Binary(0.11), 256).rays > 0


def test_walls_all_around_are_left_to_rays():
    outside = box((0, 0, 0), (1, 1, 1), 0.2).mesh
    room = Mesh(outside.vertices, outside.faces[:, ::-1])
    baked = check_same(room, ao.Binary(), 256)
    assert baked.rays_skipped["open"] == 0


def test_few_rays_are_traced_without_asking():
    baked = ao.bake(Mesh(*hills()), samples=16)
    assert baked.rays_skipped["open"] == 0
    assert baked.skip_seconds["open"] == 0


def test_what_is_skipped_is_the_same_for_any_number_of_threads():
    mesh = Mesh(*hills(40))
    bakes = [ao.bake(mesh, samples=512, threads=n) for n in (1, 2, 5)]
    assert len({(baked.rays, baked.rays_skipped["open"]) for baked in bakes}) == 1
    assert bakes[0].rays_skipped["open"] > 0


class Stopped(Exception):
    pass


def test_a_continued_bake_counts_what_the_first_run_skipped(tmp_path):
    mesh, path = Mesh(*hills(40)), tmp_path / "w.npy.partial"
    whole = ao.bake(mesh, samples=512)

    def stop(done, total):
        if done > total / 2:
            raise Stopped

    with pytest.raises(Stopped), Checkpoint(path, after=0, every=0, tell=lambda line: None) as checkpoint:
        ao.bake(mesh, samples=512, progress=stop, checkpoint=checkpoint)
    with Checkpoint(path, resume=True) as checkpoint:
        again = ao.bake(mesh, samples=512, checkpoint=checkpoint)
    assert bits(again) == bits(whole)
    assert (again.rays, again.rays_skipped) == (whole.rays, whole.rays_skipped)


@pytest.mark.parametrize("faces", [1, 16, 17, 300, 5000])
def test_a_tree_holds_every_triangle_once_within_its_boxes(faces):
    corners = np.random.default_rng(faces).normal(size=(faces, 3, 3)).astype(np.float32)
    tree = BVH16.of(corners.reshape(-1, 3), np.arange(3 * faces).reshape(-1, 3), np.arange(3 * faces))
    leaves = tree.triangles[:, :9].transpose(0, 2, 1).reshape(-1, 9)
    held = leaves[~np.isnan(leaves[:, 0])]
    assert np.array_equal(np.sort(held, axis=0), np.sort(corners.reshape(-1, 9), axis=0))
    points = tree.triangles[:, :9].reshape(-1, 3, 3, 16).transpose(0, 1, 3, 2).reshape(len(tree.triangles), 48, 3)
    low, high = np.nanmin(points, axis=1), np.nanmax(points, axis=1)
    for level in range(len(tree.starts) - 1):
        nodes = tree.boxes[tree.starts[level] : tree.starts[level + 1]].transpose(0, 2, 1).reshape(-1, 6)
        boxes = nodes[~np.isnan(nodes[:, 0])]
        assert len(boxes) == len(low)
        assert (boxes[:, :3] - boxes[:, 3:] <= low).all()
        assert (boxes[:, :3] + boxes[:, 3:] >= high).all()
        padded = np.full((-(-len(low) // 16) * 16, 3), np.nan)
        padded[: len(low)], upper = low, padded.copy()
        upper[: len(high)] = high
        low, high = np.nanmin(padded.reshape(-1, 16, 3), axis=1), np.nanmax(upper.reshape(-1, 16, 3), axis=1)
    assert len(low) == 1
