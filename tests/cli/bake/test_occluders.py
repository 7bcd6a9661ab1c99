"""`--occluder` and `--ground`: what only occludes, in every kind of bake, in reports and in parts."""

import json
import re
import shlex

import numpy as np
import pytest
from command import refused_without_a_trace, succeeded
from mesh_files import obj

from obscurance import ao, scenes
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.geometry.polyhedra import icosphere

FEW = "--samples", "16"
VERTICES, FACES = icosphere(2)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A ball, and two smaller ones that touch nothing."""
    monkeypatch.chdir(tmp_path)
    for name, radius, x in (("ball", 1.0, 0.0), ("left", 0.4, -1.5), ("right", 0.4, 1.5)):
        (tmp_path / f"{name}.obj").write_bytes(obj(radius * VERTICES + [x, 0.0, 0.0], FACES))
    return tmp_path


AROUND = "--occluder", "left.obj", "--occluder", "right.obj", "--ground", "-1.5"


def baked(*options, output="w.npy"):
    return succeeded("bake", "ball.obj", "-o", output, *FEW, *options)


def grey(path):
    return read_image(path)[0]["beauty"].mean()


def expected():
    ball, left, right = (scenes.load(f"{name}.obj").mesh for name in ("ball", "left", "right"))
    return ao.bake(ball, samples=16, occluders=[left, right, ao.ground(ball, -1.5)]).w.astype(np.float32)


def test_w_is_that_of_python_and_the_report_repeats_it(folder):
    baked(*AROUND, "--report", "r.json")
    assert np.array_equal(np.load("w.npy"), expected())
    report = json.loads((folder / "r.json").read_text())
    assert [each["path"] for each in report["inputs"]] == ["ball.obj", "left.obj", "right.obj"]
    assert report["options"]["occluder"] == ["left.obj", "right.obj"]
    before = (folder / "w.npy").read_bytes()
    for command in (shlex.split(report["command"])[1:], ["bake", "-o", "w.npy", "--options", "r.json"]):
        (folder / "w.npy").unlink()
        succeeded(*command)
        assert (folder / "w.npy").read_bytes() == before


def test_batches_textures_and_glb(folder):
    succeeded("bake", "ball.obj", "left.obj", "--output-dir", "out", *FEW, "--ground", "auto")
    w = scenes.load("out/ball.ply").w
    assert w[np.argmin(VERTICES[:, 1])] < 0.2
    for name, more in (("open", ()), ("closed", AROUND)):
        baked("--uv", "unwrap", "--size", "64", "--mesh-output", "m.glb", *more, output=f"{name}.exr")
    assert grey("closed.exr") < grey("open.exr") - 0.05
    baked(*AROUND, "--occlusion", "ramp", output="w.glb")
    assert np.allclose(scenes.load("w.glb").w[: len(expected())], expected(), atol=1e-4)


def test_a_dry_run_counts_them(folder):
    vertices, faces = icosphere(6)
    (folder / "wall.obj").write_bytes(obj(0.4 * vertices + [0, 0, 3], faces))
    alone, around = (baked("--dry-run", *more).stdout for more in ((), ("--occluder", "wall.obj")))
    beside = [float(re.search(r"([\d.]+) MiB of it beside", text)[1]) for text in (alone, around)]
    assert beside[1] > beside[0] + 8
    assert "162 vertices" in around
    assert not (folder / "w.npy").exists()


def test_up(folder):
    baked("--ground", "auto", "--up", "z", "--report", "r.json")
    w = np.load("w.npy")
    succeeded("bake", "-o", "again.npy", "--options", "r.json")
    assert np.array_equal(np.load("again.npy"), w)
    assert w[np.argmin(VERTICES[:, 2])] < 0.2 < w[np.argmin(VERTICES[:, 1])]


def test_another_unit_is_pointed_out(folder):
    (folder / "wall.obj").write_bytes(obj(5000 * VERTICES + 9000, FACES))
    assert "wall.obj: its radius is 5e+03 of the mesh's: is its unit another?" in baked("--occluder", "wall.obj").stderr


def test_an_occluder_is_not_overwritten(folder):
    baked(output="left.ply")
    line = "bake", "ball.obj", "-o", "left.ply", "--occluder", "left.ply", *FEW
    refused_without_a_trace(folder, ["left.ply, an input"], *line)
