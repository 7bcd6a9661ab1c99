"""Baking to a tolerance: kept, honestly estimated, and by fewer rays than brute force."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from meshes import crumpled, grid, hills

from benchmarks.accuracy.dense_meshes import JUMPS, PAIRS
from benchmarks.accuracy.density import Judgement, Truth
from obscurance import ao
from obscurance.ao.estimate.cells import Cells, nearest_baked
from obscurance.ao.estimate.one_ring import Neighbours
from obscurance.ao.estimate.probes import Copies
from obscurance.ao.estimate.ray_plan import RATE
from obscurance.ao.estimate.upsampling import upsample
from obscurance.ao.execute.tracer import Tracer
from obscurance.ao.points.receivers import find_receivers
from obscurance.ao.rays.ray_scene import RayScene
from obscurance.raytrace import Mesh, OptionError
from obscurance.raytrace.mesh.placement import Placement
from obscurance.scenes.geometry.builtin_shapes import temple
from obscurance.scenes.geometry.polyhedra import icosphere

pytestmark = pytest.mark.usefixtures("w_alone")

MESHES = {"hills": Mesh(*hills(60)), "temple": temple(fineness=0.6)}


def rms(difference: npt.ArrayLike) -> float:
    return float(np.sqrt(np.mean(np.square(difference))))


@cache
def truth_of(name: str) -> np.ndarray:
    return ao.bake(MESHES[name], ao.Binary(), samples=4096, seed=999, denoise=False).w


def check(name: str, seeds: int, tolerances: tuple[float, ...], denoise: bool = True) -> None:
    truth = truth_of(name)
    kept, ratios = [], []
    for seed in range(seeds):
        for tolerance in tolerances:
            baked = ao.bake(MESHES[name], ao.Binary(), seed=seed, tolerance=tolerance, denoise=denoise)
            true = rms(baked.w - truth)
            kept.append(true <= tolerance)
            ratios.append(baked.rmse / true)
    assert np.mean(kept) >= 0.95
    assert max(ratios) < 1.4
    assert min(ratios) > 1 / 1.4


@pytest.mark.parametrize("name", MESHES)
def test_the_tolerance_is_kept_and_the_error_estimated(name: str) -> None:
    check(name, 2, (0.03, 0.005))


@pytest.mark.parametrize("name", MESHES)
def test_the_tolerance_is_kept_by_rays_alone(name: str) -> None:
    """Without denoising rays alone bring the error down, and more of them; about as many where few vertices err."""
    check(name, 1, (0.03, 0.01), denoise=False)
    alone, denoised = (ao.bake(MESHES[name], ao.Binary(), tolerance=0.01, denoise=denoise) for denoise in (False, True))
    assert alone.rays > 0.9 * denoised.rays


@pytest.mark.slow
@pytest.mark.parametrize("name", MESHES)
def test_the_tolerance_is_kept_over_forty_seeds(name: str) -> None:
    check(name, 40, (0.03, 0.01, 0.005))


def test_few_vertices_that_are_far_off_do_not_hide_that_the_tolerance_is_missed() -> None:
    """A rough sphere, mostly open, whose first rays seem to meet the tolerance."""
    mesh = Mesh(*crumpled(icosphere(6), 0.1, 5))
    some = np.arange(len(mesh.vertices)) % 4 == 0
    truth = ao.bake(mesh, ao.Binary(), samples=1024, seed=1, denoise=False, only=some).w
    baked = ao.bake(mesh, ao.Binary(), tolerance=0.01)
    assert rms((baked.w - truth)[some]) < 1.2 * 0.01
    assert baked.rmse <= 0.01


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_where_few_vertices_have_most_of_the_error_it_is_measured_too(seed: int) -> None:
    """Sharp valleys in a smooth, dense sphere."""
    _, dense = PAIRS["bumpy sphere"](seed)
    truth = Truth.of(dense)
    bakes = [Judgement.of(dense, truth, 0.01, seed) for seed in (5, 6)]
    assert 1 / 1.3 < rms([baked.reported for baked in bakes]) / rms([baked.rmse for baked in bakes]) < 1.3


def untraced(side: int) -> Copies:
    """The vertices of hills, before any ray."""
    mesh = Mesh(*hills(side))
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement)
    points = receivers.points
    scene = RayScene(placement.vertices, receivers.faces, receivers.hierarchy)
    mu = ao.Binary().resolve(mesh.radius).in_render_space(placement.scale)
    return Copies(Tracer(scene, mu, placement.diagonal, 1, len(points)), points)


def test_rays_are_counted_site_by_site() -> None:
    traced = untraced(12)
    chance, count = np.random.default_rng(3), len(traced.points)
    rays, worth = np.zeros(count), np.zeros(count)
    for turn in range(4):
        more = chance.choice(np.array([0, 4, 8, 12], np.int32), count)
        traced.add(more, np.uint32(turn))
        rays += more
        worth += more**RATE
    assert np.array_equal(traced.rays, rays)
    assert np.allclose(traced.worth_at(slice(None)), worth)
    some = np.array([7, 3])
    assert np.array_equal(traced.rays_at(some), rays[some])


def test_the_first_rays_of_neighbours_are_even_together() -> None:
    """The mean of four that follow one another errs by less than four that know nothing of each other would."""
    traced = untraced(100)
    truth = traced.tracer.gather(traced.points, 256, np.uint32(9))[:, 0, 0]
    traced.add(np.full(len(truth), 8, np.int32), np.uint32(1), shared=True)
    error = (traced.gathered[0][:, 0] - truth)[: len(truth) // 4 * 4].reshape(-1, 4)
    assert rms(error.mean(axis=1)) < 0.42 * rms(error)


def test_few_rounds_of_rays_are_enough() -> None:
    """Each denoises the whole mesh, and its rays are less even together with others."""
    stages = set[str]()
    ao.bake(JUMPS["sharp creases"](3), ao.Binary(), tolerance=0.01, progress=lambda *now: stages.add(now[2]))
    assert sum(stage.startswith("rays, round") for stage in stages) <= 3


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_pilot_sample_says_how_many_rays_meet_the_tolerance(seed: int) -> None:
    """Many times as many as at first, but by one round, of which little too much."""
    stages = set[str]()
    mesh = JUMPS["bumpy height field"](seed)
    baked = ao.bake(mesh, ao.Binary(), tolerance=0.006, progress=lambda *now: stages.add(now[2]))
    assert {stage for stage in stages if stage.startswith("rays,")} == {"rays, pilot sample", "rays, round 1"}
    assert 20 * len(mesh.vertices) < baked.rays
    assert 0.7 * 0.006 < baked.rmse <= 0.006


def test_a_dense_mesh_costs_what_its_shape_does() -> None:
    """The same surface in four times as many faces takes far less than four times the rays."""
    coarse, dense = (ao.bake(Mesh(*hills(side)), ao.Binary(), tolerance=0.01) for side in (130, 260))
    assert coarse.rays < 50 * len(coarse.w)
    assert dense.rays < 32 * len(dense.w)
    assert dense.rays_skipped["predicted"] > 0


def test_what_was_predicted_is_within_the_tolerance_too() -> None:
    mesh = Mesh(*hills(150))
    looked_at = np.random.default_rng(0).random(len(mesh.vertices)) < 0.05
    truth = ao.bake(mesh, ao.Binary(), samples=4096, seed=99, only=looked_at).w
    baked = ao.bake(mesh, ao.Binary(), tolerance=0.01)
    assert rms((baked.w - truth)[looked_at]) <= 0.011
    assert ((baked.w >= 0) & (baked.w <= 1)).all()
    np.testing.assert_allclose(np.linalg.norm(baked.bent_normals, axis=1), 1, atol=1e-6)


def test_samples_are_the_most() -> None:
    with pytest.warns(ao.ToleranceWarning, match="tolerance 0.0001 is not met.*32 rays a vertex") as warned:
        baked = ao.bake(MESHES["hills"], ao.Binary(), samples=32, tolerance=1e-4)
    assert warned[0].filename == __file__
    assert baked.rmse > 1e-3
    assert baked.rays_skipped["predicted"] == 0


@pytest.mark.parametrize(("tolerance", "others"), [
    (0, {}), (-0.1, {}), (2, {}), (np.nan, {}), ("1%", {}), (True, {}),
])  # fmt: skip
def test_mistakes(tolerance: object, others: dict[str, object]) -> None:
    with pytest.raises(OptionError):
        ao.bake(MESHES["hills"], tolerance=tolerance, **others)  # type: ignore[arg-type]


def test_what_varies_linearly_is_filled_in_exactly() -> None:
    mesh = Mesh(*grid(19))
    receivers = find_receivers(mesh, Placement.of(mesh))
    near = Neighbours.of(receivers.faces, receivers.of_vertex, receivers.points.normals, 2)
    baked = np.arange(400) % 4 == 0
    owner = nearest_baked(near, baked)
    assert baked[owner].all()
    cells = Cells.of(owner)
    rows = cells.centres
    joined = cells.joined(near, receivers.points.normals[rows])
    place = receivers.points.origins.astype(np.float64)
    value = np.column_stack([0.2 + 0.3 * place[:, 0] - 0.1 * place[:, 1], np.full(400, 0.75)])
    filled = upsample(receivers.points, cells.cell, joined, receivers.points[rows], value[rows])
    assert np.abs(filled[:, 0] - value[:, 0]).max() < 0.02  # on the rim it leans on one side
    assert rms(filled[:, 0] - value[:, 0]) < 0.004
    np.testing.assert_array_equal(filled[:, 1], value[:, 1])
    opposed = replace(receivers.points, normals=-receivers.points.normals)  # all weights are as small as they can be
    again = upsample(opposed, cells.cell, joined, receivers.points[rows], value[rows])
    np.testing.assert_allclose(again, filled, atol=1e-5)


def test_a_part_without_a_baked_point_is_baked() -> None:
    """Forty small islands beside a dense sheet: the stride misses some, and each is found."""
    vertices, faces = hills(150)
    islands = np.random.default_rng(0).uniform(-1, 1, (40, 1, 3)) + np.array([[0, 0, 2], [0.1, 0, 2], [0, 0.1, 2]])
    more = np.arange(120).reshape(-1, 3) + len(vertices)
    mesh = Mesh(np.concatenate([vertices, islands.reshape(-1, 3)]), np.concatenate([faces, more]))
    baked = ao.bake(mesh, ao.Binary(), tolerance=0.02)
    truth = ao.bake(mesh, ao.Binary(), samples=1024, only=np.arange(len(mesh.vertices)) >= len(vertices)).w
    assert rms((baked.w - truth)[len(vertices) :]) < 0.08


def test_predicted_texels_are_not_traced_for_the_noise_of_those_that_predict_them() -> None:
    """A page of few rays at first: what centres of blocks err by, all of their blocks do, until there are more."""
    vertices, faces = hills(24)
    place = vertices[:, :2] - vertices[:, :2].min(axis=0)
    uv = (0.01 + 0.98 * place / place.max(axis=0))[faces]
    mesh = Mesh(vertices, faces)
    truth = ao.bake_texture(mesh, uv, 128, "binary", samples=512, seed=9)
    baked = ao.bake_texture(mesh, uv, 128, "binary")
    true = rms((baked.w - truth.w)[truth.covered])
    assert true < 1.2 * 0.005
    assert 1 / 1.4 < baked.rmse / true < 1.4
    assert baked.rays < 1000 * baked.covered.sum()  # 3,000 each where blocks were broken up for noise
