"""The bake as a whole: what it counts, what it promises of its own error, what it refuses."""

import numpy as np
import pytest
import trimesh
from meshes import hills

from obscurance import ao
from obscurance.raytrace import Mesh, OptionError
from obscurance.raytrace.kernel import jit
from obscurance.scenes.geometry.builtin_shapes import temple


@pytest.fixture(scope="module")
def colonnade():
    return temple(fineness=0.6)


@pytest.fixture(scope="module")
def reference(colonnade):
    return ao.bake(colonnade, ao.Binary(), samples=2048, seed=999).w


@pytest.mark.parametrize("samples", [16, 100, 256])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_estimated_rmse_is_the_true_one(colonnade, reference, samples, seed):
    baked = ao.bake(colonnade, ao.Binary(), samples=samples, seed=seed)
    true = np.sqrt(np.mean((baked.w - reference) ** 2))
    assert true / 1.4 < baked.rmse < true * 1.4


def test_the_estimated_errors_show_where_the_error_is(colonnade, reference):
    baked = ao.bake(colonnade, ao.Binary(), samples=64)
    off = np.abs(baked.w - reference)
    order = np.argsort(baked.error)
    quiet, noisy = off[order[: len(off) // 4]], off[order[-len(off) // 4 :]]
    assert np.sqrt(np.mean(noisy**2)) > 2 * np.sqrt(np.mean(quiet**2))
    assert np.mean(off <= 2 * baked.error + 1e-12) > 0.85


def test_agreement_alone_never_reads_as_certainty(colonnade):
    baked = ao.bake(colonnade, ao.Binary(), samples=16)
    assert (baked.error > 0).all()


def test_rays_are_counted():
    calls = []
    sphere = trimesh.creation.icosphere(subdivisions=3)
    soup = Mesh(sphere.triangles.reshape(-1, 3), np.arange(3 * len(sphere.faces)).reshape(-1, 3))
    baked = ao.bake(soup, ao.Binary(), samples=10, progress=lambda done, total, stage: calls.append((done, total)))
    points, calibration = len(sphere.vertices), 2 * 128
    assert baked.rays == 10 * (points + calibration)
    skipped = dict.fromkeys(("no_normal", "not_wanted", "predicted", "hidden"), 0)
    skipped["duplicate"] = 10 * (len(soup.vertices) - points)
    assert baked.rays_skipped == skipped
    assert calls[-1] == (baked.rays, baked.rays)


def test_coincident_vertices_get_the_same_value(colonnade):
    baked = ao.bake(colonnade, ao.Binary(), samples=64, interior="ignore")
    doubled = Mesh(
        np.vstack([colonnade.vertices, colonnade.vertices]),
        np.vstack([colonnade.faces, colonnade.faces + len(colonnade.vertices)]),
        np.vstack([colonnade.normals, colonnade.normals]),
    )
    again = ao.bake(doubled, ao.Binary(), samples=64, interior="ignore")
    np.testing.assert_array_equal(again.w[: len(baked.w)], again.w[len(baked.w) :])
    assert again.rays == baked.rays


@pytest.mark.parametrize("method", ["vertex", "surface"])
def test_vertices_without_a_normal_are_open_and_flagged(method):
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [2, 0, 0]], [[0, 1, 2], [4, 4, 0]])
    baked = ao.bake(mesh, samples=256, method=method)
    assert baked.w.tolist() == [1.0] * 5
    assert baked.error[3:].tolist() == [0, 0]
    assert {name: count for name, count in baked.flagged.items() if count} == {"unreferenced": 1, "degenerate": 1}
    if method == "vertex":
        assert baked.rays_skipped["no_normal"] == 2 * 256


@pytest.mark.parametrize("method", ["vertex", "surface"])
@pytest.mark.parametrize("length", [1, 0])
def test_a_mesh_of_degenerate_faces_alone_is_open(length, method):
    baked = ao.bake(Mesh([[0, 0, 0], [length, 0, 0], [2 * length, 0, 0]], [[0, 1, 2]]), method=method)
    assert baked.w.tolist() == [1.0] * 3
    assert baked.rays == 0
    assert baked.rmse == 0


def test_rays_that_all_agree_estimate_an_error_that_vanishes_with_their_number():
    sphere = trimesh.creation.icosphere(subdivisions=3)
    baked = ao.bake(sphere, ao.Binary(), samples=64)
    assert (baked.w == 1).all()
    assert 0 < baked.rmse < 1e-4


def test_bent_normals_lean_away_from_a_wall():
    floor = trimesh.creation.box((10, 10, 0.1))
    wall = trimesh.creation.box((0.1, 10, 5), trimesh.transformations.translation_matrix((1.0, 0, 2.55)))
    both = trimesh.util.concatenate([floor.subdivide().subdivide(), wall])
    mesh = Mesh(both.vertices, both.faces)
    baked = ao.bake(mesh, ao.Binary(), samples=1024)
    at = np.flatnonzero((np.abs(mesh.vertices - [0, 0, 0.05]) < 1e-9).all(axis=1))
    bent = baked.bent_normals[at[0]]
    assert np.linalg.norm(bent) == pytest.approx(1)
    assert bent[0] < -0.2
    assert abs(bent[1]) < 0.02
    assert bent[2] > 0.5


def test_bent_normals_are_exact_for_the_open_plane():
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    baked = ao.bake(mesh, samples=4096)
    np.testing.assert_allclose(baked.bent_normals, [[0, 0, 1]] * 3, atol=2e-3)
    assert baked.w.tolist() == [1.0] * 3


@pytest.mark.parametrize("samples", [1, 3, 8, 9, 255])
def test_any_number_of_samples_is_traced_exactly(samples):
    """Inside a closed box binary w is 0, whatever the number; a forgotten lane would leave it open."""
    box = trimesh.creation.box()
    baked = ao.bake(Mesh(box.vertices, box.faces[:, ::-1]), ao.Binary(), samples=samples)
    assert not baked.w.any()


def test_a_bake_of_some_vertices_is_that_part_of_the_whole(colonnade):
    wanted = np.arange(len(colonnade.vertices)) % 3 == 0
    whole = ao.bake(colonnade, samples=16, denoise=False, interior="mark")
    part = ao.bake(colonnade, samples=16, only=wanted, denoise=False, interior="mark")
    np.testing.assert_array_equal(part.flags[wanted], whole.flags[wanted])
    np.testing.assert_array_equal(part.w[wanted], whole.w[wanted])
    assert (part.w[~wanted] == 1).all()
    assert part.rays < 0.5 * whole.rays
    assert part.rays_skipped["not_wanted"] == 16 * np.count_nonzero(~wanted)
    with pytest.raises(OptionError, match="only: expected bool"):
        ao.bake(colonnade, only=wanted[:-1])


def test_arrays_of_any_layout_make_the_same_bits_by_the_same_kernels():
    vertices, faces = hills(8)
    w = ao.bake(Mesh(vertices, faces), samples=16).w
    before = len(jit.loaded)
    other = Mesh(np.asfortranarray(vertices), np.asfortranarray(faces))
    assert ao.bake(other, samples=16).w.tobytes() == w.tobytes()
    assert len(jit.loaded) == before
