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


BAD_SCENES = {
    "missing mesh": (BALL + '[[objects]]\nmesh = "gone.ply"\n', ("objects[2].mesh", "existing file", "gone.ply")),
    "missing texture": (TEXTURED, ("objects[0].texture", "existing file", "paint.png")),
    "file out of the folder": (BALL + '[[objects]]\nmesh = "../a.ply"\n', ("objects[2].mesh", "../a.ply")),
    "missing baked file": ('[obscurance]\nbaked = "w.npy"\n' + BALL, ("obscurance.baked", "w.npy")),
    "unknown material": (BALL.replace("red_plastic", "cheese"), ("objects[1].material", "cheese")),
    "unknown model": (BALL.replace('"red_plastic"', '{ model = "toon" }'), ("objects[1].material", "toon")),
    "unknown key": (BALL.replace("radius", "radios"), ("objects[1].radios", "unknown")),
    "unknown table": (BALL + "[fog]\nend = 3\n", ("fog", "unknown")),
    "zero size": ("[render]\nwidth = 0\n" + BALL, ("render.width", "got 0")),
    "NaN light": (BALL.replace("intensity = 20.0", "intensity = nan"), ("lights[0].intensity", "nan")),
    "light at infinity": (BALL.replace("[2.0, -2.0, 3.0]", "[inf, 0, 0]"), ("lights[0].position", "inf")),
    "unknown light": (BALL.replace('"point"', '"laser"'), ("lights[0]", "laser")),
    "no object": ("background = 0.5\n", ("objects",)),
    "not TOML": (BALL + "]\n", ("line 28",)),
    "empty": ("", ("empty",)),
}


@pytest.mark.parametrize("fault", BAD_SCENES)
def test_a_fault_of_the_scene_is_named_with_its_place(tmp_path, fault):
    text, words = BAD_SCENES[fault]
    check_refused(tmp_path, write_ball(tmp_path, text), ("ball.toml", *words))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--width", 48), ("--width", "--height")),
        (("--height", 48), ("--width", "--height")),
        (("--width", 0, "--height", 32), ("width", "got 0")),
        (("--width", 99999, "--height", 32), ("width", "got 99999")),
        (("--width", "wide", "--height", 32), ("--width", "whole number")),
        (("--samples", 0), ("samples", "got 0")),
        (("--crop", "1,2,3"), ("--crop", "1,2,3")),
        (("--crop", "a,b,c,d"), ("--crop", "a,b,c,d")),
        (("--crop", "40,20,9,9", *SMALL), ("crop", "48×32")),
        (("--crop", "0,0,0,5"), ("crop",)),
        (("--crop=-1,0,5,5",), ("crop", "-1")),
        (("--shading", "toon"), ("shading", "quadratic", "toon")),
        (("--obscurance", "deep"), ("obscurance", "ambient and diffuse", "deep")),
        (("--seed", -1), ("seed", "got -1")),
        (("--threads", 0), ("threads", "got 0")),
        (("--half",), ("half", ".exr")),
        (("--report", "no/such/folder/r.json"), ("r.json",)),
        (("--glow", 1), ("--glow",)),
    ],
    ids=lambda value: " ".join(map(str, value)),
)
def test_bad_options_are_named(tmp_path, options, words):
    check_refused(tmp_path, write_ball(tmp_path), words, *options)


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


@pytest.mark.parametrize("name", ["gone.toml", "gone.glb", "gone.ply"])
def test_a_missing_scene(tmp_path, name):
    check_refused(tmp_path, tmp_path / name, (name, "existing file"))


def test_a_folder_is_not_a_scene(tmp_path):
    refused(obscurance("render", tmp_path, "-o", tmp_path / "picture.png"), "folder")


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


def test_a_mesh_that_is_none(tmp_path):
    (tmp_path / "noise.ply").write_bytes(b"\x89PNG not a mesh")
    check_refused(tmp_path, tmp_path / "noise.ply", ("noise.ply", "PLY"))


def test_scenes_that_are_not_there(tmp_path):
    refused(obscurance("scenes", "teapot"), "cornell", "teapot")
    refused(obscurance("scenes", "-o", tmp_path / "x.toml"), "NAME")
    refused(obscurance("scenes", "cornell", "-o", tmp_path / "no" / "x.toml"), "x.toml")
    assert not list(tmp_path.iterdir())


def test_pictures_that_cannot_be_compared(tmp_path):
    a, b = tmp_path / "a.png", tmp_path / "b.png"
    write_image(a, np.zeros((4, 4, 3)))
    write_image(b, np.zeros((4, 5, 3)))
    refused(obscurance("compare", a, b), "b.png", "size", "4×4", "5×4")
    refused(obscurance("compare", a, tmp_path / "gone.png"), "gone.png", "existing file")
    refused(obscurance("compare", a, a, "--metric", "taste"), "--metric", "taste")
    refused(obscurance("compare", a, a, "--difference", tmp_path / "d.bmp"), "d.bmp")
    assert sorted(tmp_path.iterdir()) == [a, b]


@pytest.mark.parametrize("threshold", ["-1", "nan"])
def test_a_threshold_out_of_range(tmp_path, threshold):
    image = tmp_path / "a.png"
    write_image(image, np.zeros((4, 4, 3)))
    options = ("--threshold", threshold, "--difference", tmp_path / "d.png")
    refused(obscurance("compare", image, image, *options), "--threshold", threshold)
    assert list(tmp_path.iterdir()) == [image]


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
