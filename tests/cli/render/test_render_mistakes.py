"""`obscurance render` and `compare` given what cannot be: one line, exit status 2, every file as it was."""

import os

import numpy as np
import pytest
import trimesh
from command import interrupted_command, obscurance, refused
from render_scenes import BALL, SMALL, write_ball

from obscurance.raytrace.image.write import write_image

PRECIOUS = {"png": b"\x89PNG\r\n\x1a\n precious", "exr": b"\x76\x2f\x31\x01 precious"}
TEXTURED = '[[objects]]\nbuiltin = "plane"\ntexture = "paint.png"\n[obscurance]\nform = "off"\n'


def check_refused(folder, scene, words, *options, target="picture.png"):
    """The command fails with `words`; no file of the folder is changed, made or removed."""
    (folder / "picture.png").write_bytes(PRECIOUS["png"])
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    refused(obscurance("render", scene, "-o", folder / target, *options), *words)
    assert {path: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


@pytest.mark.parametrize("target", ["picture.bmp", "picture", "no/such/folder/picture.png", "."])
def test_bad_targets_are_refused_before_the_work(tmp_path, target):
    check_refused(tmp_path, tmp_path / "gone.toml", (), target=target)


def test_a_folder_that_takes_no_files(tmp_path):
    if os.name == "nt" or os.geteuid() == 0:
        target, words = "/proc/picture.png", ("cannot write",)
    else:
        closed = tmp_path / "closed"
        closed.mkdir(mode=0o500)
        target, words = closed / "picture.png", ("cannot write",)
    check_refused(tmp_path, write_ball(tmp_path), words, target=target)


@pytest.mark.parametrize("content", [b"no picture at all", b"", "half"])
def test_a_damaged_texture(tmp_path, content):
    if content == "half":
        write_image(tmp_path / "paint.png", np.random.default_rng(0).random((64, 64, 3)))
        content = (tmp_path / "paint.png").read_bytes()[:4000]
    (tmp_path / "paint.png").write_bytes(content)
    check_refused(tmp_path, write_ball(tmp_path, TEXTURED), ("paint.png",), *SMALL)


def test_a_baked_file_of_another_mesh(tmp_path):
    trimesh.creation.box().export(tmp_path / "box.ply")
    np.save(tmp_path / "w.npy", np.ones(5, np.float32))
    text = '[obscurance]\nbaked = "w.npy"\n[[objects]]\nmesh = "box.ply"\n'
    check_refused(tmp_path, write_ball(tmp_path, text), ("w.npy", "8 values", "got 5"), *SMALL)


@pytest.mark.skipif(os.name == "nt", reason="signals")
@pytest.mark.parametrize("ending", ["png", "exr"])
def test_an_interrupt_leaves_nothing_behind(tmp_path, ending):
    blurred = BALL.replace("[camera]", "[camera]\naperture = 3.0")  # so that few pixels agree early
    scene, target = write_ball(tmp_path, blurred), tmp_path / f"picture.{ending}"
    target.write_bytes(PRECIOUS[ending])
    size = ("--width", "2048", "--height", "2048", "--samples", "512", "--obscurance", "off")
    status, errors = interrupted_command("obscurance.raytrace.renderer.render", "render", scene, "-o", target, *size)
    assert status == 130
    assert "interrupted" in errors
    assert "Traceback" not in errors
    assert target.read_bytes() == PRECIOUS[ending]
    assert len(list(tmp_path.iterdir())) == 2
