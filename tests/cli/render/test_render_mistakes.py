"""`obscurance render` and `compare` given what cannot be: one line, exit status 2, every file as it was."""

import os

import numpy as np
import pytest
from command import interrupted_command, refused_without_a_trace
from scene_files import BALL, SMALL, write_ball

from obscurance.raytrace.image.write import write_image

PRECIOUS = {"png": b"\x89PNG\r\n\x1a\n precious", "exr": b"\x76\x2f\x31\x01 precious"}
TEXTURED = '[[objects]]\nbuiltin = "plane"\ntexture = "paint.png"\n[obscurance]\nform = "off"\n'


@pytest.mark.parametrize("content", [b"no picture at all", b"", "half"])
def test_a_damaged_texture(tmp_path, content):
    if content == "half":
        write_image(tmp_path / "paint.png", np.random.default_rng(0).random((64, 64, 3)))
        content = (tmp_path / "paint.png").read_bytes()[:4000]
    (tmp_path / "paint.png").write_bytes(content)
    scene = write_ball(tmp_path, TEXTURED)
    refused_without_a_trace(tmp_path, ("paint.png",), "render", scene, "-o", tmp_path / "picture.png", *SMALL)


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
