"""The command as a user meets it: its files, its exit status and its one line."""

import json
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from command import obscurance, process, refused, succeeded
from project import ROOT

from obscurance.raytrace.image.read import read_image


@pytest.fixture
def cube(tmp_path):
    path = tmp_path / "cube.ply"
    trimesh.creation.box().export(path)
    return path


def test_the_same_command_gives_the_same_bytes(tmp_path, cube):
    for ending, run in (("npy", obscurance), ("npz", process), ("ply", obscurance), ("glb", process)):
        for name, once_more in (("a", obscurance), ("b", run)):
            assert once_more("bake", cube, "-o", tmp_path / f"{name}.{ending}", "--samples", 32).returncode == 0
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()


def test_the_report_holds_the_contract(tmp_path, cube):
    report = tmp_path / "r.json"
    target = tmp_path / "w.npy"
    succeeded("bake", cube, "-o", target, "--samples", 16, "--seed", 3, "--report", report)
    found = json.loads(report.read_text())
    facts = {
        "vertices",
        "w",
        "error",
        "error_calibration",
        "rmse_estimate",
        "falloff",
        "rays",
        "interpolation",
        "rays_skipped",
        "seconds",
    }
    flags = {"flagged", "flagged_vertices", "flagged_vertices_at_most"}
    asked = {"schema_version", "kind", "verdict", "warnings", "command", "inputs", "options", "seed", "versions"}
    assert set(found) == facts | flags | asked
    assert set(found["seconds"]) == {"load", "build", "bake", "write"}
    assert found["rays"] == 16 * (8 + 2 * 8)
    assert found["seed"] == 3
    assert found["options"]["falloff"] == "exponential"
    assert found["options"]["threads"] >= 1
    assert found["falloff"]["tau"] == pytest.approx(np.log(2) / (0.5 * 3**0.5 / 2))


def test_the_summary_says_what_became_of_vertices_inside_solids(tmp_path):
    path = tmp_path / "boxes.ply"
    post, block = trimesh.creation.box((1, 1, 4)).subdivide(), trimesh.creation.box((3, 3, 3))
    trimesh.util.concatenate([post.apply_translation((0, 0, 2)), block]).export(path)
    command = ("bake", path, "-o", tmp_path / "w.npy", "--samples", 16)
    inside = "9 of 34 vertices lie inside solids"
    assert (
        f"{inside}; w, the openness, is taken from visible neighbours\n"
        in obscurance(*command, "--interior", "fill").stdout
    )
    assert f"{inside}\n" in obscurance(*command, "--interior", "mark").stdout


def test_the_debug_image_marks_vertices_inside_solids(tmp_path):
    block, ball = trimesh.creation.box((4, 4, 1)), trimesh.creation.icosphere(subdivisions=3)
    for _ in range(4):
        block = block.subdivide()
    trimesh.util.concatenate([block, ball.apply_translation((0.03, 0.02, 0.47))]).export(tmp_path / "sunk.ply")
    bake = ("bake", tmp_path / "sunk.ply", "-o", tmp_path / "w.npy", "--samples", 16, "--interior", "fill")
    succeeded(*bake, "--debug-image", tmp_path / "marked.png")
    picture = read_image(tmp_path / "marked.png")[0]["beauty"]
    magenta = (picture[..., 0] > 0.9) & (picture[..., 1] < 0.05) & (picture[..., 2] > 0.5)
    assert magenta.sum() > 1000
    refused(obscurance(*bake, "--debug-image", tmp_path / "marked.txt"), "--debug-image")


def test_the_demonstration_makes_a_mesh_and_a_picture(demonstration):
    mesh = trimesh.load(demonstration / "temple.ply", process=False)
    w = mesh.metadata["_ply_raw"]["vertex"]["data"]["obscurance"]
    assert 0 <= w.min() < 0.1
    assert w.max() == 1
    picture = read_image(demonstration / "temple.png")[0]["beauty"][..., 1]
    without, with_w = picture[:, :180], picture[:, -180:]
    assert (with_w <= without + 0.01).all()
    assert with_w.mean() < 0.95 * without.mean()


LIGHT = """
import sys
from obscurance import cli
sys.argv[0] = "obscurance"
try:
    cli.main()
finally:
    heavy = "numpy", "numba", "trimesh", "scipy", "obscurance.scenes.formats"
    print([name for name in heavy if name in sys.modules])
"""


@pytest.mark.parametrize("arguments", [["--help"], ["bake", "--help"], ["cook"], ["scenes"], ["scenes", "temple"]])
def test_help_and_mistakes_need_no_heavy_import(arguments):
    command = [sys.executable, "-c", LIGHT, *arguments]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.stdout.splitlines()[-1] == "[]", result.stderr


@pytest.mark.parametrize(
    ("target", "options", "expected"),
    [
        ("w.glb", (), "ramp"),
        ("w.glb", ("--occlusion", "ramp"), "ramp"),
        ("w.glb", ("--colors",), "none"),
        ("w.glb", ("--occlusion", "none"), "none"),
        ("w.ply", (), "none"),
    ],
)
def test_the_report_has_the_occlusion_texture_that_was_asked_for(tmp_path, cube, target, options, expected):
    report = tmp_path / "r.json"
    succeeded("bake", cube, "-o", tmp_path / target, "--samples", 8, "--report", report, *options)
    assert json.loads(report.read_text())["options"]["occlusion"] == expected
