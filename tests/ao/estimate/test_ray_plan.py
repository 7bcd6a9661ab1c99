"""Rays that a round adds, against the same rule written out for each point."""

from __future__ import annotations

import numpy as np
import pytest
from meshes import hills

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
