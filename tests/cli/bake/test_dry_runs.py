"""`bake --dry-run` reports what a bake would take and write, and writes nothing."""

import re

import pytest
from command import obscurance, refused
from mesh_files import obj
from meshes import hills

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 1 1 .5\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(20)))
    (tmp_path / "more.obj").write_text(TRIANGLE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def plan(*arguments, status=0):
    """The lines of a dry run by their names; those of one name one after the other."""
    done = obscurance("bake", *arguments, "--dry-run")
    assert done.returncode == status, done.stderr
    rows = {}
    for line in done.stdout.splitlines():
        name, text = re.split(r"  +", line, maxsplit=1)
        rows[name] = f"{rows[name]}; {text}" if name in rows else text
    return rows


def test_a_bake_is_described_and_nothing_is_written(folder):
    (folder / "w.npy").write_bytes(b"\x93NUMPY precious")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    rows = plan("hills.obj", "-o", "w.npy", "--samples", 64, "--report", "r.json")
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
    assert rows["would bake"] == "at most 400 vertices"
    assert rows["rays"] == "at most 25,600, 64 each"
    assert re.match(r"about [\d.]+ [MG]iB in all, \d+ MiB of it beside the mesh", rows["memory"])
    assert re.match(r"about [\d.e-]+ s, with 4 million rays a second on each of \d+ threads", rows["time"])
    assert rows["would write"] == "w.npy in place of the one there; r.json"


@pytest.mark.usefixtures("folder")
def test_a_pipe_is_described(standard_input):
    standard_input(obj(*hills(20)))
    rows = plan("-", "-o", "w.npy", "--samples", 64, "--input-format", "obj")
    assert (rows["would bake"], rows["would write"]) == ("at most 400 vertices", "w.npy")


def test_a_texture_has_texels_and_a_tolerance_no_time(folder):
    rows = plan("more.obj", "-o", "ao.png", "--size", "64x32", "--samples", 16)
    assert rows["would bake"] == "at most 2,048 texels"
    assert rows["rays"] == "at most 32,768, 16 each"
    assert rows["time"].startswith("at most ")
    assert plan("hills.obj", "-o", "w.npy", "--tolerance", 0.01)["time"].startswith("as long as the tolerance takes")


def test_a_batch_is_described_as_a_whole(folder):
    rows = plan("hills.obj", "more.obj", "--output-dir", "out/deep", "--samples", 16)
    assert rows["would bake"] == "2 meshes, at most 403 vertices"
    assert rows["would write"] == "out/deep/hills.ply; out/deep/more.ply; out/deep/manifest.json"
    assert sorted(path.name for path in folder.iterdir()) == ["hills.obj", "more.obj"]
    (folder / "noise.obj").write_text("noise")
    rows = plan("*.obj", "--output-dir", "out", "--samples", 16, status=1)
    assert rows["would bake"] == "2 meshes, at most 403 vertices"
    assert (list(rows)[-1], rows["would fail"]) == ("would fail", "1 of 3 meshes")


def test_of_a_mesh_without_a_usable_face_there_is_nothing_to_bake(folder):
    (folder / "flat.obj").write_text("v 0 0 0\nv 0 0 0\nv 1 0 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 1/3\n")
    rows = plan("flat.obj", "-o", "w.npy")
    assert rows["would bake"] == "at most 0 vertices"
    assert rows["time"] == "none: there is nothing to bake"
    refused(obscurance("bake", "flat.obj", "-o", "ao.png", "--size", 16), "expected faces with an area on the page")
