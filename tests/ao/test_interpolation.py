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

UP = np.array([0.0, 0.0, 1.0])
FLOOR = np.array([(-2.0, -2.0, 0.0), (2.0, -2.0, 0.0), (2.0, 2.0, 0.0), (-2.0, 2.0, 0.0)])
LID = np.array([(-0.9, -0.7, 0.5), (0.7, -0.7, 0.5), (0.7, 0.9, 0.5), (-0.9, 0.9, 0.5)])
PART = join([polygon(FLOOR), polygon(LID)])


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
    assert baked.interpolation.rmse < 0.015
    assert ao.bake(PART, "binary").coarse
    assert ao.bake(hills(8), "binary", method="surface").interpolation.rmse < ao.bake(hills(8)).interpolation.rmse


def test_some_bakes_do_not_measure_it():
    mesh = Mesh(*hills(8))
    assert ao.bake(mesh, samples=16, only=np.arange(64) < 9, denoise=False).interpolation is None
    assert ao.bake(mesh, samples=16, high=mesh).interpolation is None


def test_vertices_without_normals_are_no_obstacle():
    normals = np.full((8, 3), np.nan)
    expected = ao.bake(Mesh(*PART), samples=16).interpolation[:2]
    assert ao.bake(Mesh(*PART, normals), samples=16, normals="file").interpolation[:2] == expected
    normals[:4] = UP
    assert ao.bake(Mesh(*PART, normals), samples=16, normals="file").interpolation.rmse > 0.1


@pytest.mark.parametrize("method", ["vertex", "surface"])
def test_a_command_reports_it_in_one_line(tmp_path, method):
    (tmp_path / "lid.ply").write_bytes(ply(*PART))
    page = tmp_path / "r.html"
    line = tmp_path / "lid.ply", "-o", tmp_path / "w.ply", "--report", page, "--method", method, "--samples", 256
    result = obscurance("bake", *line)
    found = [text for text in result.stderr.splitlines() if "between the vertices w, the openness, errs by 0." in text]
    assert len(found) == 1
    assert found[0].endswith(": add --method surface" if method == "vertex" else ": subdivide them")
    assert "between the vertices w, the openness, errs by 0." in page.read_text()


@pytest.mark.parametrize(
    ("options", "remedy"), [((), "--occlusion texture --uv unwrap"), (("--colors", "rgb"), "--method surface")]
)
def test_what_helps_a_glb_is_named(tmp_path, options, remedy):
    (tmp_path / "lid.ply").write_bytes(ply(*PART))
    result = obscurance("bake", tmp_path / "lid.ply", "-o", tmp_path / "w.glb", "--samples", 256, *options)
    assert f"as the faces are too large for it: add {remedy}\n" in result.stderr


def test_what_helps_a_page_is_the_surface_method(tmp_path):
    (tmp_path / "lid.ply").write_bytes(ply(*PART))
    line = "bake", tmp_path / "lid.ply", "-o", tmp_path / "w.html", "--samples", 256
    assert ": add --method surface\n" in obscurance(*line).stderr
    assert obscurance(*line, "--method", "surface").returncode == 0
    assert ": subdivide them\n" in obscurance(*line, "--interior", "ignore").stderr


def test_it_is_measured_when_it_is_asked_for():
    baked = ao.bake(Mesh(*PART), samples=64)
    assert "interpolation" not in vars(baked)
    again = pickle.loads(pickle.dumps(baked))
    assert again.interpolation.rmse == baked.interpolation.rmse > 0.1
    assert np.array_equal(again.w, baked.w)


def test_what_is_inside_of_solids_is_found_after_a_fit():
    mesh = Temple(fineness=1.0).geometry().mesh
    assert ao.bake(mesh, method="surface", samples=16).interpolation is not None
