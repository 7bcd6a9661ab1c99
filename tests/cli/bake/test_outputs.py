"""No command writes over what it reads, twice to one file, or over a file of another kind."""

import json
import os

import numpy as np
import pytest
from command import obscurance, refused, succeeded
from gltf_files import HALVES, QUAD, Builder
from mesh_files import ply
from meshes import hills
from PIL import Image

from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.image.write import write_image
from obscurance.raytrace.system.checks import check_ending, check_outputs
from obscurance.scenes.description.read import read_scene

SCENE = '[[objects]]\nmesh = "mesh.ply"\n[[objects]]\nbuiltin = "plane"\ntexture = "paint.png"\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A mesh, a scene of it with a texture, a glTF with an image and a buffer, a picture, and links to some."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mesh.ply").write_bytes(ply())
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "notes.json").write_text('{"name": "mine"}')
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "mine"\n')
    (tmp_path / "notes.png").write_text("mine")
    Image.new("RGB", (2, 2), (200, 10, 10)).save(tmp_path / "paint.png")
    write_image(tmp_path / "a.png", np.zeros((4, 4, 3)))
    write_image(tmp_path / "b.png", np.ones((4, 4, 3)))
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, HALVES))
    header = builder.gltf([{"mesh": 0}], uri="quad.bin", images=[{"uri": "paint.png"}])
    (tmp_path / "quad.bin").write_bytes(builder.binary)
    (tmp_path / "quad.gltf").write_text(json.dumps(header))
    (tmp_path / "sub").mkdir()
    (tmp_path / "soft.ply").symlink_to("mesh.ply")
    (tmp_path / "soft.json").symlink_to("mesh.ply")
    (tmp_path / "future.json").symlink_to("w.npy")
    os.link(tmp_path / "mesh.ply", tmp_path / "hard.ply")
    os.link(tmp_path / "a.png", tmp_path / "hard.png")
    return tmp_path


REFUSED = [
    ("bake mesh.ply -o mesh.ply", "--output"),
    ("bake mesh.ply -o sub/../mesh.ply", "--output"),
    ("bake mesh.ply -o soft.ply", "--output"),
    ("bake mesh.ply -o hard.ply", "--output"),
    ("bake soft.ply -o mesh.ply", "--output"),
    ("bake mesh.ply -o w.npy --report mesh.ply", "--report"),
    ("bake mesh.ply -o w.npy --report w.npy", "--report"),
    ("bake mesh.ply -o w.npy --report new.ply", "--report"),
    ("bake mesh.ply -o w.npy --report soft.json", "--report"),
    ("bake mesh.ply -o w.npy --report future.json", "--report"),
    ("bake mesh.ply -o w.npy --report notes.json", "--report"),
    ("bake mesh.ply -o w.npy --debug-image notes.png", "--debug-image"),
    ("bake quad.gltf -o w.npy --debug-image paint.png", "--debug-image"),
    ("render scene.toml -o p.png --report scene.toml", "--report"),
    ("render scene.toml -o paint.png", "--output"),
    ("render scene.toml -o notes.png", "--output"),
    ("render scene.toml -o p.png --report soft.json", "--report"),
    ("render scene.toml -o p.png --report p.png", "--report"),
    ("render quad.gltf -o paint.png", "--output"),
    ("scenes temple -o mesh.ply", "--output"),
    ("scenes temple -o new.ply", "--output"),
    ("scenes temple -o pyproject.toml", "--output"),
    ("compare a.png b.png --difference a.png", "--difference"),
    ("compare a.png b.png --difference b.png", "--difference"),
    ("compare a.png b.png --difference hard.png", "--difference"),
    ("compare a.png b.png --difference notes.png", "--difference"),
    ("bench mesh.ply --report mesh.ply", "--report"),
    ("bench mesh.ply --report soft.json", "--report"),
    ("bench --report notes.json", "--report"),
]


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(("line", "option"), REFUSED, ids=[line for line, _ in REFUSED])
def test_a_command_that_would_destroy_a_file_is_refused_before_the_work(folder, line, option):
    before = contents(folder)
    refused(obscurance(*line.split()), f"{option}: expected")
    assert contents(folder) == before


def test_a_baked_file_of_a_scene_is_an_input(folder):
    (folder / "scene.toml").write_text('[obscurance]\nbaked = "w.npy"\n' + SCENE)
    np.save("w.npy", np.ones(3))
    os.link("w.npy", "hard.json")
    description = read_scene("scene.toml")
    assert {path.name for path in description.files} == {"scene.toml", "mesh.ply", "paint.png", "w.npy"}
    with pytest.raises(OptionError, match=r"--report: expected a file that is not read, got hard\.json, an .*w\.npy"):
        check_outputs({"--report": "hard.json"}, description.files)


def test_the_demonstration_does_not_write_twice_to_one_file(folder):
    (folder / "demo").mkdir()
    (folder / "demo" / "temple.ply").symlink_to("temple.png")
    refused(obscurance("demo", "-o", "demo"), "temple.png: expected another file than temple.ply")
    (folder / "demo" / "temple.ply").unlink()
    (folder / "demo" / "temple.png").write_text("mine")
    refused(obscurance("demo", "-o", "demo"), "temple.png: expected a free name or a PNG picture")


def test_a_second_run_replaces_what_the_first_made(folder):
    for _ in range(2):
        line = "bake mesh.ply -o w.npy --samples 8 --report r.json --debug-image marked.png"
        succeeded(*line.split())
        line = "render scene.toml -o p.exr --report p.json --preview"
        succeeded(*line.split())
        succeeded("scenes", "temple", "-o", "temple.toml")
        succeeded("compare", "a.png", "b.png", "--difference", "d.tif")


def test_an_empty_file_may_be_replaced(tmp_path):
    (tmp_path / "w.npy").touch()
    check_outputs({"--output": tmp_path / "w.npy"})


def test_endings_are_read_in_either_case(tmp_path):
    check_ending("--report", tmp_path / "R.JSON", ".json")
    with pytest.raises(OptionError, match=r"--report: expected a name ending in \.json"):
        check_ending("--report", tmp_path / "r.txt", ".json")


def test_quiet_leaves_out_warnings_about_w_that_the_report_keeps(tmp_path):
    (tmp_path / "hills.ply").write_bytes(ply(*hills(6)))
    arguments = (
        "bake",
        tmp_path / "hills.ply",
        "-o",
        tmp_path / "w.ply",
        "--report",
        tmp_path / "r.json",
        *("--samples", 256, "--half-distance", "10%"),
    )
    about_w = "between the vertices w, the openness, errs by", "29 of 36 vertices lie on hard edges"
    said = obscurance(*arguments).stderr
    assert obscurance(*arguments, "-q").stderr == ""
    warnings = json.loads((tmp_path / "r.json").read_text())["warnings"]
    assert all(words in said and any(words in line for line in warnings) for words in about_w)
