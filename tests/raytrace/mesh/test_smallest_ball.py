"""The smallest ball about points: Welzl's answer by trying every set of carriers, and what must not change it."""

import itertools

import numpy as np
import pytest

from obscurance.raytrace.mesh.smallest_ball import smallest_ball

RANDOM = np.random.default_rng(7)


def of_every_set(points):
    """The smallest of the balls through two to four points that hold all."""
    radii = []
    for chosen in itertools.chain.from_iterable(itertools.combinations(points, count) for count in (2, 3, 4)):
        around = np.array(chosen[1:]) - chosen[0]
        centre = chosen[0] + np.linalg.lstsq(around, (around * around).sum(axis=1) / 2, rcond=None)[0]
        radius = np.linalg.norm(centre - chosen[0])
        if np.linalg.norm(points - centre, axis=1).max() <= radius * (1 + 1e-9):
            radii.append(radius)
    return min(radii)


@pytest.mark.parametrize("thickness", [0, 1e-6, 1, 100])
@pytest.mark.parametrize("count", [2, 3, 4, 5, 12])
def test_no_set_of_points_has_a_smaller_ball(count, thickness):
    for _ in range(8):
        points = RANDOM.normal(size=(count, 3)) * [1, 1, thickness]
        centre, radius = smallest_ball(points)
        assert radius == pytest.approx(of_every_set(points), rel=1e-9)
        assert np.linalg.norm(points - centre, axis=1).max() <= radius * (1 + 1e-12)


ON_A_SPHERE = RANDOM.normal(size=(500, 3))
ON_A_SPHERE /= np.linalg.norm(ON_A_SPHERE, axis=1)[:, None]
CASES = {
    "one point": (np.ones((4, 3)), 0.0),
    "a cube": (np.array(list(itertools.product((0.0, 1.0), repeat=3))), 0.75**0.5),
    "an equilateral triangle": (np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.75**0.5, 0]]), 3**-0.5),
    "an obtuse triangle": (np.array([[-1, 0, 0], [1, 0, 0], [0.0, 0.5, 0]]), 1.0),
    "points of a sphere": (ON_A_SPHERE, 1.0),
    "a ball of more points than the sample": (np.append(ON_A_SPHERE, RANDOM.uniform(-0.5, 0.5, (20_000, 3)), 0), 1.0),
    "huge": (3e153 * ON_A_SPHERE, 3e153),
    "tiny": (1e-300 * ON_A_SPHERE, 1e-300),
    "far away": (ON_A_SPHERE + 1e6, 1.0),
}


@pytest.mark.parametrize("name", CASES)
def test_known_balls(name):
    points, radius = CASES[name]
    assert smallest_ball(points)[1] == pytest.approx(radius, rel=1e-9, abs=0)
