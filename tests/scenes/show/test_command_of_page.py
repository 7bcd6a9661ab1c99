"""The command that a page of a bake shows: whole, with the options, into a file that keeps materials."""

import json
import re
import shlex

import numpy as np
import pytest
from command import succeeded
from mesh_files import ply
from meshes import hills
from PIL import Image

from obscurance import ao
from obscurance.scenes import load, read_w

PAINTED = (
    "mtllib m.mtl\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 0 0 1\nv 2 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl paint\n"
)
FACES = "f 1/1 2/2 3/3 4/4\nf 1/1 5/4 6/3 2/2\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a b").mkdir()
    (tmp_path / "a b" / "m.obj").write_text(PAINTED + FACES)
    (tmp_path / "a b" / "m.mtl").write_text("newmtl paint\nmap_Kd p.png\n")
    Image.new("RGB", (2, 2), (9, 90, 200)).save(tmp_path / "a b" / "p.png")
    (tmp_path / "bare.ply").write_bytes(ply(*hills(6)))
    return tmp_path


def command_of(mesh, *options):
    succeeded("bake", mesh, "-o", "page.html", "--profile", *options)
    with open("page.html") as file:
        (text,) = re.findall(r'"permanent": ("(?:[^"\\]|\\.)*")', file.read())
    return json.loads(text)


def test_it_has_the_options_and_keeps_materials(folder):
    options = ("--samples", 64, "--seed", 7, "--interior", "ignore", "--ground", "-1")
    command = command_of("a b/m.obj", *options)
    name, *words = shlex.split(command.replace("{}", "40%"))
    assert name == "obscurance"
    succeeded(*words)
    made = load(folder / "m-baked.glb")
    assert made.raw.header["materials"][1]["pbrMetallicRoughness"]["baseColorTexture"]
    succeeded("bake", "a b/m.obj", "-o", "w.glb", "--half-distance", "40%", *options)
    np.testing.assert_array_equal(read_w("m-baked.glb"), read_w("w.glb"))


def test_it_is_short_where_nothing_was_asked_for(folder):
    assert command_of("bare.ply") == "obscurance bake bare.ply --output bare-baked.ply --half-distance {}"


def test_a_page_made_in_python_shows_python(folder):
    baked = ao.bake(load("bare.ply"), samples=8, profile=True)
    baked.save("python.html")
    assert r'"permanent": "baked.profile.at(\"{}\")"' in (folder / "python.html").read_text()
