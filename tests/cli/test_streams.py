"""Standard input and standard output in place of files."""

import io
import subprocess
import sys
from types import SimpleNamespace

import pytest
from command import COMMAND, obscurance, refused
from mesh_files import glb, obj, off, ply, stl
from meshes import hills, two_boxes

from raytrace.system import atomic
from scenes.formats.gltf.asset import decode
from scenes.formats.load import standard_input

VERTICES, FACES = two_boxes()


def give(monkeypatch, content, terminal=False):
    stream = SimpleNamespace(buffer=io.BytesIO(content), isatty=lambda: terminal)
    monkeypatch.setattr(sys, "stdin", stream)


def test_a_pipe_gives_the_bytes_of_a_file(tmp_path):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(6)))
    options = "--samples", "64", "--half-distance", "5%"  # which vertices so far apart cannot show
    single = obscurance("bake", tmp_path / "hills.obj", "-o", tmp_path / "w.ply", *options)
    assert single.returncode == 0
    command = [*COMMAND, "bake", "-", "-o", "-", "--format", "ply", *options]
    done = subprocess.run(command, input=obj(*hills(6)), capture_output=True, cwd=tmp_path, check=True)
    assert done.stdout == (tmp_path / "w.ply").read_bytes()
    *warnings, summary = done.stderr.decode().splitlines()
    assert summary.startswith("<stdout>.ply: 36 vertices, ")
    assert warnings == single.stderr.replace(str(tmp_path / "w.ply"), "<stdout>.ply").splitlines()
    assert [line.split(" w, ")[0] for line in warnings] == ["warning: <stdout>.ply: between the vertices"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hills.obj", "w.ply"]


def test_a_pipe_gives_its_object_a_name(tmp_path):
    command = [*COMMAND, "bake", "-", "-o", "-", "--format", "glb", "--samples", "16"]
    done = subprocess.run(command, input=obj(*hills(6)), capture_output=True, cwd=tmp_path, check=True)
    assert decode(done.stdout, tmp_path / "w.glb").header["nodes"][0]["name"] == "mesh"
    command[command.index("glb")] = "html"
    done = subprocess.run(command, input=obj(*hills(6)), capture_output=True, cwd=tmp_path, check=True)
    assert b"<title>standard input " in done.stdout
    assert b"stdin&gt;" not in done.stdout


FORMATS = {
    "ply": ply(),
    "obj": b"# made by hand\n\nmtllib x.mtl\n" + obj(VERTICES, FACES),
    "stl": stl(VERTICES[FACES].astype("f4")),
    "off": off(),
    "glb": glb(),
}


@pytest.mark.parametrize("kind", FORMATS)
def test_the_first_bytes_show_the_format(monkeypatch, kind):
    give(monkeypatch, FORMATS[kind])
    path, content = standard_input(None)
    assert (path.suffix, content) == (f".{kind}", FORMATS[kind])


def test_a_text_of_facets_is_an_stl(monkeypatch):
    give(monkeypatch, b"solid x\n  facet normal 0 0 1\n")
    assert standard_input(None)[0].suffix == ".stl"


def test_a_format_that_is_given_is_taken_at_its_word(tmp_path, monkeypatch):
    give(monkeypatch, ply())
    refused(obscurance("bake", "-", "-o", tmp_path / "w.npy", "--input-format", "obj"), "<stdin>.obj: faces: expected")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "content: expected a mesh, got nothing"),
        (
            b"junk",
            "standard input: format: expected one of 3MF, GLB, glTF, OBJ, OFF, PLY, STL, or --input-format",
        ),
        (b"v 0 0 0\n", "<stdin>.obj: faces: expected at least one triangle"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_line(tmp_path, monkeypatch, content, words):
    give(monkeypatch, content)
    refused(obscurance("bake", "-", "-o", tmp_path / "w.npy"), words)
    assert not list(tmp_path.iterdir())


def test_terminals_are_neither_read_nor_written(tmp_path, monkeypatch):
    give(monkeypatch, b"", terminal=True)
    refused(
        obscurance("bake", "-", "-o", tmp_path / "w.npy"), "expected a mesh piped to standard input, got a terminal"
    )
    (tmp_path / "a.obj").write_bytes(obj())
    monkeypatch.setattr(atomic, "sys", SimpleNamespace(stdout=SimpleNamespace(isatty=lambda: True)))
    refused(obscurance("bake", tmp_path / "a.obj", "-o", "-"), "standard output: cannot write: it is a terminal")


def test_options_are_checked_before_a_pipe_is_read(tmp_path, monkeypatch):
    give(monkeypatch, b"junk")
    refused(obscurance("bake", "-", "-o", tmp_path / "w.npy", "--samples", 0), "bake --samples")
    refused(obscurance("bake", "-", "a.ply", "--output-dir", tmp_path / "out"), "--output-dir does not go with -")
    refused(obscurance("bake", "a.ply", "-o", "w.npy", "--input-format", "ply"), "--input-format needs - as INPUT")
    assert sys.stdin.buffer.tell() == 0
