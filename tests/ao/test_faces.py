"""w of faces, against form factors, and what is true of both sides of a face."""

import numpy as np
import pytest
import trimesh
from meshes import hills

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.scenes.geometry.polyhedra import generic_rotation

PERPENDICULAR_SQUARES = 0.2000438  # form factor of unit squares with an edge in common
TURNED = generic_rotation(5)
CORNER = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1.0]])
CORNER_FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 1]])


def box(side, inwards=False):
    solid = trimesh.creation.box((side,) * 3)
    return solid.vertices @ TURNED.as_matrix().T, solid.faces[:, ::-1] if inwards else solid.faces


def both(*meshes):
    return Mesh(*trimesh.util.append_faces(*zip(*meshes, strict=True)))


@pytest.mark.parametrize(
    "options", [{"samples": 1 << 13}, {"tolerance": 0.002}, {"samples": 1 << 13, "denoise": False}]
)
def test_w_of_a_binary_falloff_is_one_less_the_form_factors(options):
    baked = ao.bake((CORNER @ TURNED.as_matrix().T, CORNER_FACES), ao.Binary(), at="faces", **options)
    assert baked.w.shape == baked.error.shape == baked.flags.shape == (4,)
    assert np.abs(baked.w.reshape(2, 2).mean(axis=1) - (1 - PERPENDICULAR_SQUARES)).max() < 0.004
    assert np.abs(baked.bent_normals.mean(axis=0) @ TURNED.as_matrix() - [0, 0.5, 0.5]).max() < 0.15


def test_a_box_in_a_box():
    """Nothing is seen from between the boxes, everything from outside; of solids the inner one is hidden."""
    mesh = both(box(1), box(2))
    between = ao.bake(mesh, ao.Binary(), at="faces", both_sides=True, interior="ignore", samples=256)
    assert (between.w[:12] == 0).all()
    assert (between.w[12:] == 1).all()
    assert (between.below.w == 0).all()
    hidden = ao.bake(mesh, ao.Binary(), at="faces", interior="mark", samples=16)
    assert (hidden.flags == [ao.Flag.HIDDEN] * 12 + [0] * 12).all()


@pytest.mark.parametrize("tolerance", [pytest.param(0.02, marks=pytest.mark.slow), 0.006])
def test_the_reported_error_is_the_true_one(tolerance):
    """On faces of which w varies: the samples that measure the error lie elsewhere on them."""
    mesh = both(*((v + np.array([3 * k, 0, 0]), f) for k, (v, f) in enumerate([_cone()] * 3)))
    truth = np.mean([ao.bake(mesh, ao.Binary(), at="faces", samples=1024, seed=90 + k).w for k in (0, 1)], axis=0)
    ratios = []
    for seed in range(2):
        baked = ao.bake(mesh, ao.Binary(), at="faces", tolerance=tolerance, seed=seed)
        assert baked.rmse <= tolerance
        ratios.append(baked.rmse / np.sqrt(np.mean((baked.w - truth) ** 2)))
    assert 1 / 1.4 < np.exp(np.mean(np.log(ratios))) < 1.4


def _cone():
    """A funnel of long, thin faces that look inwards."""
    cone = trimesh.creation.cone(1, 2, sections=48)
    side = np.abs(cone.face_normals[:, 2]) < 0.9
    return cone.vertices, cone.faces[side][:, ::-1]


def test_faces_of_vertices_that_are_not_wanted_and_without_area_have_none():
    vertices = np.append(CORNER, [[2, 0, 0], [3, 0, 0]], axis=0)
    faces = np.append(CORNER_FACES, [[1, 6, 7]], axis=0)
    only = np.ones(8, np.bool_)
    only[4] = False
    baked = ao.bake((vertices, faces), ao.Binary(), at="faces", only=only, samples=64)
    assert (baked.w[2:] == [1, baked.w[3], 1]).all()
    assert (baked.error[[2, 4]] == 0).all()
    assert baked.flags.tolist() == [0, 0, 0, 0, ao.Flag.DEGENERATE]
    assert (baked.w[[0, 1, 3]] < 0.95).all()


def test_the_same_bits_for_any_number_of_threads_and_among_occluders():
    mesh = Mesh(*hills(40))
    wall = ([[0, -9, -9], [0, 9, -9], [0, 9, 9], [0, -9, 9]], [[0, 1, 2], [0, 2, 3]])
    one, two = (ao.bake(mesh, at="faces", occluders=[wall], tolerance=0.01, threads=threads) for threads in (1, 2))
    assert one.w.tobytes() == two.w.tobytes()
    assert len(one.w) == len(mesh.faces)
    assert one.interpolation is None


@pytest.mark.parametrize("options", [{"samples": 16}, {"tolerance": 0.01}], ids=["rays", "tolerance"])
def test_faces_at_the_same_place_are_traced_once(options):
    ball = trimesh.creation.icosphere(subdivisions=1)
    plate = Mesh([(-9, -9, -1.5), (9, -9, -1.5), (0, 9, -1.5)], [(0, 1, 2)])
    turned = [np.roll(ball.faces, k, axis=1) + k * len(ball.vertices) for k in range(5)]
    one, many = (
        ao.bake(mesh, "binary", at="faces", occluders=[plate], **options)
        for mesh in ((ball.vertices, ball.faces), (np.tile(ball.vertices, (5, 1)), np.concatenate(turned)))
    )
    assert many.rays == one.rays
    assert np.array_equal(many.w, np.tile(many.w[: len(ball.faces)], 5))
    assert abs(many.w[: len(ball.faces)] - one.w).max() < 0.05


def test_faces_at_the_same_place_that_look_elsewhere_are_apart():
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (-9, -9, 0.2), (9, -9, 0.2), (0, 9, 0.2)]
    baked = ao.bake((corners, [(0, 1, 2), (0, 2, 1), (3, 4, 5)]), "binary", at="faces", samples=256)
    assert baked.w[0] < 0.1
    assert baked.w[1] == 1
