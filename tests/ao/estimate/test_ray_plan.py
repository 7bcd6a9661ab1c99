"""Rays that a round adds, against the same rule written out for each point."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from meshes import grid, hills

from obscurance import ao
from obscurance.ao.estimate.ray_plan import RATE, rays_to_add
from obscurance.raytrace import Mesh


@pytest.mark.parametrize("fall", [1.08, 1.5])
def test_rays_are_added_by_the_root_of_error_and_of_rays(fall: float) -> None:
    random = np.random.default_rng(7)
    error = 10 ** random.uniform(-6, -2, 4000)
    rays = random.choice([8.0, 12.0, 40.0], 4000)
    more = rays_to_add(error, rays**RATE, 1 << 12, 0.3 * error.mean(), fall, 2)
    added = np.where(more > 0, (rays**RATE + more**RATE) ** (1 / RATE), rays)
    left = error * (rays / added) ** fall
    assert 0.8 < left.mean() / (0.3 * error.mean()) < 1.2
    wish = (error * rays**fall) ** (1 / (fall + 0.6))
    clear = more > 8
    ratio = added[clear] / wish[clear]
    assert np.quantile(ratio, 0.95) / np.quantile(ratio, 0.05) < 1.6  # steps are of a third to a half
    assert more[np.argmin(error)] == 0
    assert (more % 4 == 0).all()


def test_a_tolerance_needs_no_second_hierarchy(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise AssertionError("Embree's hierarchy is built")

    monkeypatch.setattr("obscurance.raytrace.embree.EmbreeScene.__init__", refused)
    assert ao.bake(Mesh(*hills(40)), tolerance=0.02).rmse <= 0.02


@cache
def open_terrain() -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Gentle waves, of which few rays meet anything, and their w (10,000,) by many rays."""
    vertices, faces = grid(99, 100.0)
    rng = np.random.default_rng(2)
    for wave, height, phase in zip(
        rng.uniform(-0.6, 0.6, (12, 2)), rng.uniform(0.05, 0.25, 12), rng.uniform(0, 6, 12), strict=True
    ):
        vertices[:, 2] += height * np.sin(vertices[:, :2] @ wave + phase)
    return (vertices, faces), ao.bake((vertices, faces), "binary", 2048, denoise=False, seed=99).w


@pytest.mark.parametrize("denoise", [True, False])
def test_the_mean_is_right_where_few_rays_meet_anything(denoise: bool) -> None:
    """If sites got rays by what their own rays have met, it would be .0004 too large, .0017 without denoising."""
    mesh, exact = open_terrain()
    off = [ao.bake(mesh, "binary", tolerance=0.005, seed=seed, denoise=denoise).w.mean() for seed in range(6)]
    assert abs(np.mean(off) - exact.mean()) < 0.00025


def test_the_mean_over_a_mesh_is_as_even_as_the_sets_of_directions_are_together() -> None:
    """Of sets that are independent it scatters by .0013."""
    mesh, exact = open_terrain()
    off = [ao.bake(mesh, "binary", 8, seed=seed).w.mean() - exact.mean() for seed in range(10)]
    assert np.sqrt(np.mean(np.square(off))) < 0.0006
