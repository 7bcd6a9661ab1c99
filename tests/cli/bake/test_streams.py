"""Standard input and standard output in place of files."""

import os
import subprocess
import sys

import pytest
from command import COMMAND, obscurance, refused, succeeded
from mesh_files import glb, obj, off, ply, stl
from meshes import hills, two_boxes

from obscurance.raytrace.system.atomic import standard_output
from obscurance.scenes.bake.run import kept_by
from obscurance.scenes.formats.gltf.asset import decode
from obscurance.scenes.formats.load import standard_input as read_standard_input

VERTICES, FACES = two_boxes()


def test_a_pipe_gives_the_bytes_of_a_file(tmp_path):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(6)))
    options = "--samples", "64", "--half-distance", "5%"  # which vertices so far apart cannot show
    single = succeeded("bake", tmp_path / "hills.obj", "-o", tmp_path / "w.ply", *options)
    command = [*COMMAND, "bake", "-", "-o", "-", "--format", "ply", *options]
    done = subprocess.run(command, input=obj(*hills(6)), capture_output=True, cwd=tmp_path, check=True)
    assert done.stdout == (tmp_path / "w.ply").read_bytes()
    *warnings, summary = done.stderr.decode().splitlines()
    assert summary.startswith("<stdout>.ply: 36 vertices, ")
    assert warnings == single.stderr.replace(str(tmp_path / "w.ply"), "<stdout>.ply").splitlines()
    words = ["29 of 36 vertices lie on hard edges", "between the vertices w"]
    assert all(line.startswith(f"warning: <stdout>.ply: {each}") for line, each in zip(warnings, words, strict=True))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hills.obj", "w.ply"]


def test_a_pipe_gives_its_object_a_name(tmp_path):
    command = [*COMMAND, "bake", "-", "-o", "-", "--format", "glb", "--samples", "16"]
    done = subprocess.run(command, input=obj(*hills(6)), capture_output=True, cwd=tmp_path, check=True)
    assert decode(done.stdout, tmp_path / "w.glb").header["nodes"][0]["name"] == "mesh"
    command[command.index("glb")] = "html"
    done = subprocess.run(command, input=obj(*hills(6)), capture_output=True, cwd=tmp_path, check=True)
    assert b"<title>standard input " in done.stdout
    assert b"stdin&gt;" not in done.stdout


def test_rows_are_kept_beside_files_alone(tmp_path, watch):
    calls = watch("obscurance.ao.execute.kept.Kept")
    for output in (None, standard_output("ply"), tmp_path / "w.npy"):
        kept_by(None, output)
    assert [output for output, _ in calls] == [None, None, tmp_path / "w.npy"]


FORMATS = {
    "ply": ply(),
    "obj": b"# made by hand\n\nmtllib x.mtl\n" + obj(VERTICES, FACES),
    "stl": stl(VERTICES[FACES].astype("f4")),
    "off": off(),
    "glb": glb(),
}


@pytest.mark.parametrize("kind", FORMATS)
def test_the_first_bytes_show_the_format(standard_input, kind):
    standard_input(FORMATS[kind])
    path, content = read_standard_input(None)
    assert (path.suffix, content) == (f".{kind}", FORMATS[kind])


def test_a_text_of_facets_is_an_stl(standard_input):
    standard_input(b"solid x\n  facet normal 0 0 1\n")
    assert read_standard_input(None)[0].suffix == ".stl"


def test_a_format_that_is_given_is_taken_at_its_word(tmp_path, standard_input):
    standard_input(ply())
    refused(obscurance("bake", "-", "-o", tmp_path / "w.npy", "--input-format", "obj"), "<stdin>.obj: faces: expected")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "content: expected a mesh, got nothing"),
        (
            b"junk",
            "standard input: format: expected one of 3MF, COLLADA, GLB, glTF, OBJ, OFF, PLY, STL, VTK, or",
        ),
        (b"v 0 0 0\n", "<stdin>.obj: faces: expected at least one triangle"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_line(tmp_path, standard_input, content, words):
    standard_input(content)
    refused(obscurance("bake", "-", "-o", tmp_path / "w.npy"), words)
    assert not list(tmp_path.iterdir())


def test_terminals_are_neither_read_nor_written(tmp_path, standard_input):
    standard_input(b"", terminal=True)
    refused(
        obscurance("bake", "-", "-o", tmp_path / "w.npy"), "expected a mesh piped to standard input, got a terminal"
    )
    (tmp_path / "a.obj").write_bytes(obj())
    controller, terminal = os.openpty()
    command = [*COMMAND, "bake", tmp_path / "a.obj", "-o", "-"]
    done = subprocess.run(command, stdout=terminal, stderr=subprocess.PIPE, text=True)
    os.close(terminal)
    os.close(controller)
    assert (done.returncode, "standard output: cannot write: it is a terminal" in done.stderr) == (2, True)


def test_options_are_checked_before_a_pipe_is_read(tmp_path, standard_input):
    standard_input(b"junk")
    refused(obscurance("bake", "-", "-o", tmp_path / "w.npy", "--samples", 0), "bake --samples")
    refused(obscurance("bake", "-", "a.ply", "--output-dir", tmp_path / "out"), "--output-dir does not go with -")
    refused(obscurance("bake", "a.ply", "-o", "w.npy", "--input-format", "ply"), "--input-format needs - as INPUT")
    assert sys.stdin.buffer.tell() == 0
