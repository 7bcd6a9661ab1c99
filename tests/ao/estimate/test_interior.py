"""Vertices inside solids: found, reported, marked in a picture, filled from their neighbours."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command import succeeded
from meshes import crumpled as noisy

from obscurance import ao
from obscurance.ao.estimate.inside import _KEY, OutsideSampler
from obscurance.ao.points.points import Points
from obscurance.ao.points.surface_samples import SurfaceSamples
from obscurance.raytrace import Mesh, OptionError
from obscurance.scenes.geometry.polyhedra import icosphere


@pytest.fixture(scope="module")
def solids() -> Mesh:
    """A ball half sunk into a fine block."""
    block = trimesh.creation.box((4, 4, 1))
    for _ in range(4):
        block = block.subdivide()
    ball = trimesh.creation.icosphere(subdivisions=3)
    ball.apply_translation((0.03, 0.02, 0.47))
    both = trimesh.util.concatenate([block, ball])
    return Mesh(both.vertices, both.faces)


def inside(mesh: Mesh) -> np.ndarray:
    """Vertices well within the ball or the block, by their equations."""
    x, y, z = mesh.vertices.T
    in_ball = (x - 0.03) ** 2 + (y - 0.02) ** 2 + (z - 0.47) ** 2 < 0.95**2
    in_block = (np.abs(x) < 1.9) & (np.abs(y) < 1.9) & (np.abs(z) < 0.45)
    return in_ball | in_block


def outside(mesh: Mesh) -> np.ndarray:
    x, y, z = mesh.vertices.T
    off_ball = (x - 0.03) ** 2 + (y - 0.02) ** 2 + (z - 0.47) ** 2 > 1
    off_block = (np.abs(x) > 1.99) | (np.abs(y) > 1.99) | (np.abs(z) > 0.499)
    return off_ball & off_block


def test_both_sides_are_surface_if_asked(solids: Mesh) -> None:
    baked = ao.bake(solids, ao.Binary(), samples=64, interior="ignore")
    assert baked.flagged["hidden"] == 0


def parts(*meshes: trimesh.Trimesh) -> Mesh:
    both = trimesh.util.concatenate(list(meshes))
    return Mesh(both.vertices, both.faces)


def test_inside_closed_parts_vertices_are_filled_by_default(solids: Mesh) -> None:
    baked, filled = ao.bake(solids, ao.Binary(), samples=64), ao.bake(solids, ao.Binary(), samples=64, interior="fill")
    np.testing.assert_array_equal(baked.flags, filled.flags)
    np.testing.assert_array_equal(baked.w, filled.w)
    assert baked.flagged["hidden"] > 100


def test_hard_edges_stored_apart_close_a_part_too(solids: Mesh) -> None:
    loose = Mesh(solids.vertices[solids.faces].reshape(-1, 3), np.arange(solids.faces.size).reshape(-1, 3))
    found = ao.bake(loose, ao.Binary(), samples=16).flags & ao.Flag.HIDDEN != 0
    assert found[inside(loose)].all()
    assert not found[outside(loose)].any()


def test_nothing_but_closed_parts_hides_by_default() -> None:
    """Backs of open sheets, of a part's own faces, and of rooms whose faces look inwards are in sight of the eye."""
    ball, floor = trimesh.creation.icosphere(subdivisions=3), trimesh.creation.box((6, 6, 1))
    floor = floor.subdivide().subdivide().subdivide()
    floor.apply_translation((0, 0, -0.5))
    dome = trimesh.creation.icosphere(subdivisions=3, radius=2.5)
    dome.update_faces((dome.triangles[:, :, 2] > 0.01).all(axis=1))
    room = trimesh.creation.box((3, 3, 3)).subdivide()
    room.invert()
    through = trimesh.creation.box((0.5, 0.5, 5)).subdivide().subdivide()
    through.apply_translation((0.7, 0.7, 0))
    crumpled = trimesh.Trimesh(*noisy(icosphere(3), 0.5, 0), process=False)
    for mesh in (parts(dome, floor), parts(room, through), parts(crumpled), parts(crumpled, dome)):
        plain, baked = (ao.bake(mesh, samples=16, interior=policy) for policy in ("ignore", "auto"))
        assert baked.flagged["hidden"] == 0
        np.testing.assert_array_equal(baked.w, plain.w)
    assert ao.bake(parts(dome, floor), samples=16, interior="mark").flagged["hidden"] > 0
    assert ao.bake(parts(crumpled), samples=16, interior="mark").flagged["hidden"] > 0
    ball.apply_translation((0, 0, 0.1))
    assert ao.bake(parts(ball, floor, dome), samples=16).flagged["hidden"] > 0


def test_solids_in_the_way_of_a_solid_do_not_bring_to_light_what_is_in_it() -> None:
    """A ball between plates, which it sees from in front, each of two halves that touch; and all of it in a block."""
    ball = icosphere(3)
    plates = []
    for axis in range(3):
        for at in (-1.2, -1.1, 1.1, 1.2):
            size = np.full(3, 2.0)
            size[axis] = 0.1
            plates.append(trimesh.creation.box(size).apply_translation(at * np.eye(3)[axis]))
    ball = trimesh.Trimesh(*ball)
    free, buried = parts(ball, *plates), parts(ball, *plates, trimesh.creation.box((4, 4, 4)))
    count = len(ball.vertices)
    hidden = [(ao.bake(mesh, samples=16).flags & ao.Flag.HIDDEN != 0)[:count] for mesh in (free, buried)]
    assert not hidden[0].any()
    assert hidden[1].all()


def test_interpolation_no_longer_carries_the_dark_of_what_is_buried_into_sight() -> None:
    """A coarse block that a ball is half sunk into: w in the visible parts of triangles with buried corners."""
    block = trimesh.creation.box((4, 4, 1)).subdivide().subdivide().subdivide()
    fine = block.subdivide().subdivide()
    ball = trimesh.creation.icosphere(subdivisions=4)
    ball.apply_translation((0.03, 0.02, 0.5))
    coarse, dense = parts(block, ball), parts(fine, ball)
    truth = ao.bake(dense, ao.Binary(), samples=256, interior="ignore")
    x, y, z = dense.vertices[: len(fine.vertices)].T
    seen = np.flatnonzero((np.abs(z - 0.5) < 1e-6) & ((x - 0.03) ** 2 + (y - 0.02) ** 2 > 1.05**2))
    where = trimesh.proximity.closest_point_naive(block, fine.vertices[seen])[2]
    weights = trimesh.triangles.points_to_barycentric(block.triangles[where], fine.vertices[seen])
    off = {}
    for policy in ("ignore", "auto"):
        baked = ao.bake(coarse, ao.Binary(), samples=256, interior=policy)
        corners = block.faces[where]
        near = inside(coarse)[corners].any(axis=1)
        error = (weights * baked.w[corners]).sum(axis=1) - truth.w[seen]
        off[policy] = float(np.sqrt(np.mean(error[near] ** 2)))
    assert off["auto"] < off["ignore"] / 2


def test_what_is_inside_is_found_and_nothing_else(solids: Mesh) -> None:
    plain, baked = (ao.bake(solids, ao.Binary(), samples=64, interior=policy) for policy in ("ignore", "mark"))
    found = (baked.flags & ao.Flag.HIDDEN) != 0
    assert found[inside(solids)].all()
    assert not found[outside(solids)].any()
    np.testing.assert_array_equal(baked.w, plain.w)


def test_hidden_vertices_take_their_neighbours_values(solids: Mesh) -> None:
    plain, baked = (
        ao.bake(solids, ao.Binary(), samples=256, interior=policy, denoise=False) for policy in ("ignore", "fill")
    )
    found = (baked.flags & ao.Flag.HIDDEN) != 0
    np.testing.assert_array_equal(baked.w[~found], plain.w[~found])
    assert baked.rays_skipped["hidden"] > 0
    assert baked.rays + sum(baked.rays_skipped.values()) == plain.rays + sum(plain.rays_skipped.values())
    assert plain.w[found].max() < 0.05
    top = found & (np.abs(solids.vertices[:, 2] - 0.5) < 1e-6)
    assert top.sum() > 20
    assert baked.w[top].min() > 0.3


def test_an_inward_room_sees_fronts_and_an_outward_one_backs() -> None:
    box = trimesh.creation.box().subdivide()
    for faces, expected in ((box.faces[:, ::-1], 0), (box.faces, 0)):
        baked = ao.bake(Mesh(box.vertices, faces), samples=16, interior="mark")
        assert baked.flagged["hidden"] == expected
    room = trimesh.creation.box((3, 3, 3))
    both = trimesh.util.concatenate([box, room])
    assert ao.bake(Mesh(both.vertices, both.faces), samples=16, interior="mark").flagged["hidden"] == len(box.vertices)


def test_a_part_with_nothing_in_sight_keeps_its_values() -> None:
    box, room = trimesh.creation.box(), trimesh.creation.box((3, 3, 3))
    both = trimesh.util.concatenate([box, room])
    marked, filled = (
        ao.bake(Mesh(both.vertices, both.faces), ao.Binary(), samples=16, interior=policy)
        for policy in ("mark", "fill")
    )
    np.testing.assert_array_equal(marked.w, filled.w)


@pytest.mark.parametrize("options", [{"samples": 64}, {"tolerance": 0.02}], ids=str)
def test_so_does_a_closed_box_in_a_closed_box_at_faces(options: dict[str, float]) -> None:
    """No hidden face has another to take a value from."""
    boxes = trimesh.util.concatenate([trimesh.creation.box((2, 2, 2)), trimesh.creation.box((1, 1, 1))])
    baked = ao.bake(boxes, "binary", at="faces", **options)
    assert baked.w[:12].min() > 0.97
    assert baked.w[12:].max() == 0


def test_an_unknown_policy_is_a_mistake(solids: Mesh) -> None:
    with pytest.raises(OptionError, match="interior"):
        ao.bake(solids, interior="perhaps")  # type: ignore[arg-type]


def test_the_command_reports_them(solids: Mesh, tmp_path: Path) -> None:
    trimesh.Trimesh(solids.vertices, solids.faces, process=False).export(tmp_path / "solids.ply")
    options = ("--samples", 16, "--interior", "fill", "--report", tmp_path / "r.json")
    succeeded("bake", tmp_path / "solids.ply", "-o", tmp_path / "w.npy", *options)
    written = json.loads((tmp_path / "r.json").read_text())
    assert written["flagged"]["hidden"] > 100
    assert len(written["flagged_vertices"]["hidden"]) == written["flagged_vertices_at_most"] == 100


def fours_at(places: np.ndarray) -> SurfaceSamples:
    """Groups of four samples at `places` (4 k, 3)."""
    at, count = np.float32(places), len(places) // 4
    points = Points(at, at, np.arange(len(at), dtype=np.uint32), at)
    faces, normals = np.zeros(len(at), np.int32), np.zeros((len(at), 5), np.float32)
    return SurfaceSamples(4 * np.arange(count + 1), faces, points, normals, np.zeros(count, np.bool_))


def test_samples_are_outside_where_only_one_of_the_places_that_decide_is() -> None:
    def draw(sites: np.ndarray, parts: np.ndarray, key: np.uint32) -> tuple[SurfaceSamples, np.ndarray]:
        height = np.repeat((parts == 3) & (key == _KEY), 4)
        height[1::4] = False
        return fours_at(np.stack([0 * height, 0 * height, height], -1)), np.arange(len(sites))

    sampler = OutsideSampler(
        draw, lambda samples: samples.points.origins[:, 2] == 0, lambda samples: samples.counts > 0
    )
    sites = np.arange(5)
    samples, cut, hidden = sampler.settle(sites, draw(sites, 0 * sites, np.uint32(1))[0], np.uint32(2))
    assert cut.all()
    assert not hidden.any()
    assert (samples.points.origins[:, 2] > 0).all()


def test_samples_of_what_is_in_a_solid_in_part_are_even_over_the_rest() -> None:
    """Squares of which a part is in a solid: the mean of x + y errs by less than that of 16 random places."""

    def draw(sites: np.ndarray, parts: np.ndarray, key: np.uint32) -> tuple[SurfaceSamples, np.ndarray]:
        random = np.random.default_rng([int(key), *parts])
        corners = np.array([(0, 0), (0.5, 0.5), (0, 0.5), (0.5, 0)])
        x, y = ((corners + 0.5 * random.random((len(sites), 4, 2))).reshape(-1, 2) - 0.5).T
        return fours_at(np.stack([x, y, 0 * x], -1)), np.arange(len(sites))

    sampler = OutsideSampler(
        draw, lambda samples: samples.points.origins[:, 0] < -0.2, lambda samples: np.ones(len(samples), np.bool_)
    )
    sites = np.arange(2000)
    samples, cut, hidden = sampler.settle(sites, draw(sites, 0 * sites, np.uint32(1))[0], np.uint32(2))
    assert cut.all()
    assert not hidden.any()
    assert samples.points.origins[:, 0].min() >= -0.2
    assert (samples.counts[samples.all_count] == 16).all()
    means = np.add.reduceat(samples.points.origins[:, :2].sum(axis=1, dtype=float), samples.starts[:-1])
    means = (means / samples.counts)[samples.all_count]
    np.testing.assert_allclose(np.mean(means), 0.15, atol=0.005)
    assert np.std(means) < 0.75 * np.sqrt((0.7**2 + 1) / 12 / 16)  # of random ones
