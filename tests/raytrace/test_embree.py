"""Embree through kernels: what comes back is what plain geometry says."""

import numpy as np
import pytest
import trimesh

from obscurance.raytrace import EmbreeError, OptionError, embree
from obscurance.raytrace.embree import TriangleScene, intersect

SQUARE = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
SQUARE_FACES = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.fixture(scope="module")
def square():
    return TriangleScene(SQUARE, SQUARE_FACES)


def test_a_hit_gives_distance_face_and_barycentrics(square):
    hits = intersect(square, [[0.5, 0.25, 2.0], [0.25, 0.5, 2.0], [2.0, 0.5, 2.0]], [0, 0, -1])
    np.testing.assert_allclose(hits.distance, [2, 2, np.inf])
    np.testing.assert_array_equal(hits.face, [0, 1, -1])
    where = np.einsum("ij,ijk->ik", hits.barycentric[:2], SQUARE[SQUARE_FACES[hits.face[:2]]])
    np.testing.assert_allclose(where, [[0.5, 0.25, 0], [0.25, 0.5, 0]], atol=1e-6)


@pytest.mark.parametrize("count", [1, 7, 8, 9, 1000])
def test_any_number_of_rays_fills_its_packets(square, count):
    x = np.linspace(-0.5, 1.5, count)
    origins = np.stack([x, np.full(count, 0.5), np.ones(count)], axis=1)
    expected = (x >= 0) & (x <= 1)
    np.testing.assert_array_equal(intersect(square, origins, [0, 0, -1]).face >= 0, expected)


def test_rays_end_at_their_reach(square):
    origin = [[0.5, 0.25, 1.0]]
    assert intersect(square, origin, [0, 0, -1], 0.999).face[0] < 0
    assert intersect(square, origin, [0, 0, -1], 1.001).face[0] >= 0


@pytest.mark.parametrize(
    ("origins", "directions"),
    [([[0, 0, np.nan]], [0, 0, 1]), ([[0, 0, 0]], [0, 0, 0]), ([[0, 0, 0]], [0, np.inf, 0]), ([[0, 0]], [0, 1])],
)
def test_rays_that_embree_would_call_a_miss_are_refused(square, origins, directions):
    with pytest.raises(OptionError, match="origins, directions"):
        intersect(square, origins, directions)


def test_a_scene_without_faces_is_hit_by_nothing():
    empty = TriangleScene(SQUARE, np.empty((0, 3), np.int64))
    assert intersect(empty, [[0.5, 0.25, 1.0]], [0, 0, -1]).face[0] < 0


def test_thousands_of_scenes_share_one_device():
    scenes = [TriangleScene(SQUARE, SQUARE_FACES) for _ in range(3000)]
    assert intersect(scenes[-1], [[0.5, 0.25, 1.0]], [0, 0, -1]).face[0] >= 0
    assert len({int(scene.handle) for scene in scenes}) == 3000


def test_no_random_ray_leaves_a_closed_sphere():
    sphere = trimesh.creation.icosphere(subdivisions=4)
    scene = TriangleScene(np.float32(sphere.vertices), sphere.faces)
    rng = np.random.default_rng(1)
    assert (intersect(scene, rng.uniform(-0.4, 0.4, (200_000, 3)), rng.normal(size=(200_000, 3))).face >= 0).all()


def test_another_major_version_is_refused():
    embree.check_version(40300)
    with pytest.raises(EmbreeError, match=r"expected 4\.x, got 3\.13"):
        embree.check_version(31300)


def test_embrees_own_message_is_raised():
    device = embree.device()
    embree.library.rtcNewGeometry(device, 9999)
    with pytest.raises(EmbreeError, match="Embree: "):
        embree.check(device)
