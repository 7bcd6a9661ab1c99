"""What share of a hemisphere or a cone lies below a plane, and estimates without the rays there."""

import numpy as np
import pytest

from obscurance import ao
from obscurance.ao.execute.tracer import Tracer
from obscurance.ao.points.points import Points
from obscurance.ao.rays.below_face import leave_out_below, share_below
from obscurance.ao.rays.directions import COSINE, Lobe
from obscurance.ao.rays.gather import W
from obscurance.ao.rays.ray_scene import RayScene


@pytest.mark.parametrize("seed", range(3))
def test_the_share_of_a_cone_below_a_plane_is_that_of_slow_integration(seed):
    random = np.random.default_rng(seed)
    strip = (np.arange(20_000) + 0.5) / 20_000
    for _ in range(40):
        alpha, theta = np.radians([random.uniform(0.5, 90), random.uniform(0, 180)])
        # Over the disk that the cone projects to: by strips across the tilt, each cut by the plane.
        y = np.sin(alpha) * np.sin(0.5 * np.pi * (2 * strip - 1))
        width = np.sqrt(np.sin(alpha) ** 2 - y**2)
        cut = -np.cos(theta) * np.sqrt(1 - y**2)  # below is x sin θ + √(1 − x² − y²) cos θ < 0
        below = np.clip(cut, -width, width) + width
        dy = np.cos(0.5 * np.pi * (2 * strip - 1))
        assert share_below(np.cos(theta), Lobe(np.sin(alpha) ** 2)) == pytest.approx(
            (below * dy).sum() / (2 * width * dy).sum(), abs=1e-6
        )


@pytest.mark.parametrize("theta", [0.0, 20.0, 90.0, 135.0, 180.0])
def test_the_share_of_a_hemisphere(theta):
    cosine = np.cos(np.radians(theta))
    assert share_below(cosine, COSINE) == pytest.approx((1 - cosine) / 2, abs=1e-12)


@pytest.mark.parametrize("cone", [1.0, 0.75])
def test_few_rays_a_place_are_right_in_the_mean(cone):
    """Two estimates were divided, of what is open and of what is above the face: .01 too bright by two rays a place."""
    floor = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], np.float32)
    wall = np.array([[0.5, -9, 0], [0.5, 9, 0], [0.5, 9, 9], [0.5, -9, 9]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]], np.int32)
    scene = RayScene.of(np.concatenate([floor, wall]), faces, lobe=Lobe(cone))
    count = 1 << 15
    place = np.zeros((count, 3))
    axis = np.array([-0.6, 0.0, 0.8])
    points = Points.lifted(place, place + np.array([0, 0, 1e-5]), np.tile(axis, (count, 1)))
    faced = np.tile(np.array([0, 0, 1, 1, 1], np.float32), (count, 1))  # opaque, of a surface across the axis

    def mean(rays, key):
        tracer = Tracer(scene, ao.Binary().resolve(1.0).in_render_space(1.0), 99.0, 1, count)
        gathered = tracer.gather(points, rays, np.uint32(key))[:, 0].copy()
        leave_out_below(points.arrays, faced, scene.table(rays, count, np.uint32(key)), scene.lobe, gathered)
        return gathered[:, W].mean()

    assert mean(2, 1) == pytest.approx(mean(512, 2), abs=0.003)
