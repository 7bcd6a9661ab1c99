"""What a bake says of its errors' calibration is what its errors are."""

import numpy as np
import pytest
from meshes import hills

from obscurance import ao
from obscurance.ao.estimate.calibration import Calibration
from obscurance.raytrace import Mesh

pytestmark = pytest.mark.usefixtures("w_alone")

OPTIONS = {
    "raw": {"samples": 32, "denoise": False},
    "denoised": {"samples": 32},
    "to a tolerance": {"tolerance": 0.01},
}


@pytest.fixture(scope="module")
def mesh():
    return Mesh(*hills(28))


@pytest.fixture(scope="module")
def truth(mesh):
    return ao.bake(mesh, ao.Binary(), samples=4096, denoise=False, seed=99).w


@pytest.mark.parametrize("name", OPTIONS)
def test_measured_errors_are_those_of_a_reference(mesh, truth, name):
    bakes = [ao.bake(mesh, ao.Binary(), seed=seed, **OPTIONS[name]) for seed in range(16)]
    true = np.sqrt(np.mean([np.mean((bake.w - truth) ** 2) for bake in bakes]))
    found = [bake.calibration for bake in bakes]
    weight = np.concatenate([each.weight / each.weight.sum() for each in found]) / len(found)
    measured = weight @ np.concatenate([each.measured for each in found])
    estimated = weight @ np.concatenate([each.estimated for each in found])
    assert np.sqrt(measured) == pytest.approx(true, rel=0.15)
    assert np.sqrt(estimated) == pytest.approx(true, rel=0.25)


def test_errors_estimated_as_larger_are_larger(mesh):
    groups = ao.bake(mesh, ao.Binary(), samples=32).calibration.groups(2)
    assert groups[0].estimated < groups[1].estimated
    assert groups[0].measured < groups[1].measured
    assert sum(group.points for group in groups) == 128


def test_groups_are_root_mean_squares_with_their_doubt():
    found = Calibration(np.repeat([4.0, 1.0], 8), np.tile([9.0, -7.0], 8), np.ones(16))
    low, high = found.groups(2)
    assert (low.points, low.estimated, high.estimated) == (8, 1, 2)
    assert low.measured == 1
    assert low.low == 0
    assert low.high == pytest.approx(np.sqrt(1 + np.sqrt(4 * 81 + 4 * 49) / 8))
    assert found.whole().estimated == pytest.approx(np.sqrt(2.5))


def test_few_points_are_not_grouped_and_none_have_no_error():
    assert Calibration(np.ones(30), np.ones(30), np.ones(30)).groups() == []
    nothing = Calibration(np.zeros(0), np.zeros(0), np.zeros(0)).whole()
    assert nothing == (0, 0, 0, 0, 0)


def test_the_surface_method_bakes_nothing_twice(mesh):
    assert ao.bake(mesh, samples=4, method="surface").calibration is None
