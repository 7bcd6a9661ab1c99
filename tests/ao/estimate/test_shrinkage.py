"""Vertices that learn from their neighbours: never worse, nothing across creases, nothing left of it in the limit."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from meshes import hills

from obscurance import ao
from obscurance.ao.estimate import shrinkage
from obscurance.ao.estimate.calibration import distribute_variance
from obscurance.ao.estimate.one_ring import Neighbours
from obscurance.ao.estimate.shrinkage import denoise
from obscurance.ao.points.receivers import Points, find_receivers
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.placement import Placement
from obscurance.scenes.geometry.builtin_shapes import temple

pytestmark = pytest.mark.usefixtures("w_alone")

BOX = trimesh.creation.box()
SCENES = {
    "hills": Mesh(*hills(40)),
    "temple": temple(fineness=0.6),
    "boxes": Mesh(
        *(lambda m: (m.vertices, m.faces))(BOX.subdivide().subdivide() + BOX.copy().apply_translation((1.1, 0, 0)))
    ),
}


def rings(mesh: Mesh) -> tuple[Neighbours, Points]:
    receivers = find_receivers(mesh, Placement.of(mesh))
    return Neighbours.of(receivers.faces, receivers.of_vertex, receivers.points.normals, 2), receivers.points


def rows(values: np.ndarray, points: Points) -> np.ndarray:
    """What gathering would return: `values`, some spread, and nothing known of what is closed where."""
    return np.column_stack([values, np.ones(len(values)), 2 / 3 * points.normals.astype(np.float64)]).astype(np.float32)


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(difference))))


@pytest.fixture(scope="module")
def truth() -> dict[str, np.ndarray]:
    return {name: ao.bake(mesh, ao.Binary(), samples=4096, seed=999, denoise=False).w for name, mesh in SCENES.items()}


@pytest.mark.parametrize("name", SCENES)
def test_blocks_have_the_bits_of_the_whole(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    neighbours, points = rings(SCENES[name])
    gathered = np.random.default_rng(1).uniform(0.1, 1.0, (len(points), 5)).astype(np.float32)
    whole = denoise(neighbours, points, gathered, 0.01)
    monkeypatch.setattr(shrinkage, "_BLOCK", 60)
    for values, expected in zip(denoise(neighbours, points, gathered, 0.01), whole, strict=True):
        np.testing.assert_array_equal(values, expected)


def test_a_block_has_all_that_is_so_many_edges_away() -> None:
    neighbours, points = rings(SCENES["hills"])
    links = np.repeat(np.arange(len(points)), np.diff(neighbours.starts)), neighbours.indices
    for block in neighbours.blocks(300, 2):
        near = np.zeros(len(points), bool)
        near[block.of_all] = True
        for _ in range(2):
            near[links[1][near[links[0]]]] = True
        np.testing.assert_array_equal(block.rows, np.flatnonzero(near))
        np.testing.assert_array_equal(block.rows[block.of_rows], np.arange(len(points))[block.of_all])


@pytest.mark.parametrize("samples", [4, 32, 256])
@pytest.mark.parametrize("name", SCENES)
def test_never_worse_than_the_raw_estimate(name: str, samples: int, truth: dict[str, np.ndarray]) -> None:
    raw, denoised = (
        [ao.bake(SCENES[name], ao.Binary(), samples, seed, denoise=on) for seed in range(2)] for on in (False, True)
    )
    before, after = (rms(np.stack([b.w for b in some]) - truth[name]) for some in (raw, denoised))
    assert after <= 1.01 * before
    if name == "hills":
        assert after <= 0.95 * before
    estimated = np.sqrt(np.mean([b.rmse**2 for b in denoised]))
    assert after / 1.45 < estimated < 1.45 * after


def test_it_vanishes_as_samples_grow() -> None:
    moved = []
    for samples in (64, 8192):
        raw, denoised = (ao.bake(SCENES["hills"], ao.Binary(), samples, denoise=on) for on in (False, True))
        moved.append(rms(raw.w - denoised.w) / raw.rmse)
    assert moved[1] < 0.6 * moved[0]


def test_equal_values_stay_equal_to_the_bit() -> None:
    near, points = rings(SCENES["hills"])
    for value in (1.0, 0.0, 0.3):
        values = np.full(len(points), value, np.float32)
        denoised, _ = denoise(near, points, rows(values, points), 1e-2)
        np.testing.assert_array_equal(denoised, values)


def test_nothing_crosses_a_crease() -> None:
    """Loose cubes keep their edges; each side's value is its own, however noisy it is said to be."""
    cube = trimesh.creation.box().subdivide().subdivide()
    loose = Mesh(cube.triangles.reshape(-1, 3), np.arange(3 * len(cube.faces)).reshape(-1, 3))
    near, points = rings(loose)
    value = points.normals.astype(np.float64) @ [0.1, 0.2, 0.3]
    denoised, _ = denoise(near, points, rows(value, points), 0.1)
    np.testing.assert_allclose(denoised, value, atol=1e-6)


def test_a_lone_spike_is_kept() -> None:
    near, points = rings(SCENES["hills"])
    values = np.full(len(points), 0.8)
    values[700] = 0.2
    denoised, _ = denoise(near, points, rows(values, points), 1e-4)
    assert abs(denoised[700] - 0.2) < 0.01
    assert np.abs(np.delete(denoised, 700) - 0.8).max() < 0.02


def test_noise_is_averaged_and_the_gain_is_estimated() -> None:
    near, points = rings(SCENES["hills"])
    noise = np.random.default_rng(0).normal(scale=0.05, size=len(points))
    denoised, error = denoise(near, points, rows(0.5 + noise, points), 0.05**2)
    assert rms(denoised - 0.5) < 0.6 * 0.05
    assert rms(denoised - 0.5) == pytest.approx(np.sqrt(error.mean()), rel=0.35)


def test_variances_keep_their_mean_and_are_never_nothing() -> None:
    shared = distribute_variance(np.array([0.0, 1.0, 2.0, 0.0]), 0.01)
    assert shared.mean() == pytest.approx(0.01)
    assert (shared > 0).all()
    assert distribute_variance(np.zeros(3), 0.01).tolist() == [0.01] * 3
