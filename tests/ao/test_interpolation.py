"""What interpolation between vertices errs by, against closed forms; and when the command warns of it."""

import pickle

import numpy as np
import pytest
from command import obscurance
from mesh_files import ply
from meshes import hills

from obscurance import ao
from obscurance.ao.closed_forms import polygon_form_factor
from obscurance.raytrace import Mesh
from obscurance.scenes import Temple
from obscurance.scenes.geometry.polyhedra import icosphere, join, polygon


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


UP = np.array([0.0, 0.0, 1.0])
FLOOR = np.array([(-2.0, -2.0, 0.0), (2.0, -2.0, 0.0), (2.0, 2.0, 0.0), (-2.0, 2.0, 0.0)])
LID = np.array([(-0.9, -0.7, 0.5), (0.7, -0.7, 0.5), (0.7, 0.9, 0.5), (-0.9, 0.9, 0.5)])
PART = join([polygon(FLOOR), polygon(LID)])
BALL, BALL_FACES = icosphere(1)
BALLS = join([(BALL, BALL_FACES), (BALL + np.array([1.5, 0, 0]), BALL_FACES)])


def floor_error():
    """The exact RMS error over floor and lid, above which everything is open."""
    w = [1 - polygon_form_factor(LID, corner, UP) for corner in FLOOR]
    steps = (np.arange(24) + 0.5) / 24 * 4 - 2
    squared = []
    for x in steps:
        for y in steps:
            u, v = x / 4 + 0.5, y / 4 + 0.5
            shown = w[0] + (u - v) * (w[1] - w[0]) + v * (w[2] - w[0])  # in 0, 1, 2, the half with u ≥ v
            if u < v:
                shown = w[0] + (v - u) * (w[3] - w[0]) + u * (w[2] - w[0])
            squared.append((shown - 1 + polygon_form_factor(LID, np.array([x, y, 0.0]), UP)) ** 2)
    return np.sqrt(np.mean(squared) * 16 / (16 + 1.6**2))


def test_the_error_is_that_of_the_closed_form():
    """The mean square of 256 points each of twelve bakes; the bound is below the error in nearly all of them."""
    found = [ao.bake(PART, "binary", 1024, seed).interpolation for seed in range(12)]
    assert np.sqrt(np.mean([each.rmse**2 for each in found])) == pytest.approx(floor_error(), rel=0.08)
    assert all(0.6 * each.rmse < each.at_least < each.rmse for each in found)
    assert sum(each.at_least < floor_error() for each in found) >= 11


@pytest.mark.parametrize("tolerance", [0.1, 0.02, 0.005])
def test_faces_are_too_large_from_an_error_of_a_twentieth_whatever_the_tolerance(tolerance):
    found = {n: ao.bake(hills(n), "binary", tolerance=tolerance, seed=1) for n in (6, 8, 12)}
    assert [each.coarse for each in found.values()] == [True, True, False]
    assert 0.05 < found[8].interpolation.at_least < 0.1
    assert found[12].interpolation.rmse < 0.045


def test_what_any_values_at_the_vertices_leave():
    """Four vertices of a floor show no shadow in its middle, whatever their values; those of crossing balls do."""
    fitted = [ao.bake(mesh, "binary", method="surface").interpolation.rmse for mesh in (PART, BALLS)]
    best = [ao.bake(mesh, "binary").interpolation.best for mesh in (PART, BALLS)]
    np.testing.assert_allclose(best, fitted, atol=0.03)
    assert best[0] > 0.14
    assert best[1] < 0.03


@pytest.mark.parametrize("mesh", [polygon(FLOOR), icosphere(1)])
def test_what_is_open_everywhere_has_none(mesh):
    baked = ao.bake(mesh, samples=64)
    assert baked.interpolation[:2] == (0.0, 0.0)
    assert not baked.coarse


def test_fine_meshes_are_not_coarse_however_noisy():
    dense = hills(70)
    for samples in (4, 256):
        baked = ao.bake(dense, "binary", samples, denoise=False)
        assert baked.interpolation.rmse < 0.04
        assert not baked.coarse
    assert baked.interpolation.rmse < 0.02
    assert ao.bake(PART, "binary").coarse
    assert ao.bake(hills(8), "binary", method="surface").interpolation.rmse < ao.bake(hills(8)).interpolation.rmse


def test_some_bakes_do_not_measure_it():
    mesh = Mesh(*hills(8))
    assert ao.bake(mesh, samples=16, only=np.arange(64) < 9, denoise=False).interpolation is None
    assert ao.bake(mesh, samples=16, high=mesh).interpolation is None


LARGE = "as the faces are too large for it"
TEXTURE = "--occlusion texture --uv unwrap"
OR_TEXTURE = f"subdivide them, or bake a texture, {TEXTURE} into a .glb"


@pytest.mark.parametrize(
    ("part", "output", "options", "remedy"),
    [
        (BALLS, "w.ply", (), "add --method surface"),
        (BALLS, "w.html", (), "add --method surface"),
        (BALLS, "w.npy", (), "add --method surface"),
        (BALLS, "w.npy", ("--interior", "ignore"), "subdivide them"),
        (BALLS, "w.glb", (), f"add {TEXTURE}"),
        (BALLS, "w.glb", ("--colors", "rgb"), "add --method surface"),
        (PART, "w.ply", (), OR_TEXTURE.replace("subdivide them", "add --between 0.02")),
        (PART, "w.ply", ("--method", "surface"), OR_TEXTURE),
        (PART, "w.html", (), OR_TEXTURE),
        (PART, "w.html", ("--method", "surface"), OR_TEXTURE),
        (PART, "w.npz", (), "subdivide them"),
    ],
)
def test_a_command_names_what_helps_its_output(folder, part, output, options, remedy):
    (folder / "lid.ply").write_bytes(ply(*part))
    result = obscurance("bake", "lid.ply", "-o", output, "--falloff", "binary", "--tolerance", 0.02, *options)
    lines = [line for line in result.stderr.splitlines() if LARGE in line]
    assert len(lines) == 1
    assert lines[0].endswith(f"{LARGE}: {remedy}")


def test_it_is_measured_when_it_is_asked_for():
    baked = ao.bake(Mesh(*PART), samples=64)
    assert "interpolation" not in vars(baked)
    again = pickle.loads(pickle.dumps(baked))
    assert again.interpolation.rmse == baked.interpolation.rmse > 0.1
    assert np.array_equal(again.w, baked.w)


def test_what_is_inside_of_solids_is_found_after_a_fit():
    mesh = Temple(fineness=1.0).geometry().mesh
    assert ao.bake(mesh, method="surface", samples=16).interpolation is not None
