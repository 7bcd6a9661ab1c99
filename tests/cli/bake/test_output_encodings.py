"""Printing to outputs that cannot hold it: plain letters in place of Greek ones, never a traceback."""

import io
import os
import subprocess
import sys

import pytest
import trimesh
from command import obscurance, process, refused, succeeded

from obscurance.scenes.bake.console import readable_output

PLAIN = [
    {"PYTHONIOENCODING": "ascii"},
    {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"},
    {"LC_ALL": "C", "LANG": "C"},
]


def written(text, encoding):
    """The bytes that printing `text` puts on both standard streams."""
    streams = [io.TextIOWrapper(io.BytesIO(), encoding) for _ in range(2)]
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = streams
    try:
        with readable_output():
            print(text, end="")
            print(text, end="", file=sys.stderr)
    finally:
        sys.stdout, sys.stderr = before
    for stream in streams:
        assert stream.errors == "strict"
        stream.flush()
    first, second = (stream.buffer.getvalue() for stream in streams)
    assert first == second
    return first


def test_plain_letters_stand_for_others():
    text = "τ = 2, 8×8, μ, −.5, σ ≥ 0, π/2, 60°, 1…3, Poulin–Fournier, é, 界"
    plain = b"tau = 2, 8x8, mu, -.5, sigma >= 0, pi/2, 60 degrees, 1...3, Poulin-Fournier, e, \\u754c"
    assert written(text, "ascii") == plain
    assert written(text, "utf-8") == text.encode()
    assert written("τ é", "latin-1") == b"tau \xe9"
    assert written("name\udcff", "utf-8") == b"name\\udcff"


@pytest.mark.parametrize("environment", PLAIN, ids=lambda e: " ".join(f"{k}={v}" for k, v in e.items()))
def test_commands_on_ascii_outputs(tmp_path, environment):
    mesh = tmp_path / "böx→.ply"
    trimesh.creation.box().export(mesh)
    environment = {**os.environ, **environment}
    done = process(
        "bake", mesh, "-o", tmp_path / "τ.ply", "--samples", 8, "--report", tmp_path / "ρ.json", env=environment
    )
    assert done.returncode == 0, done.stderr
    assert "8 vertices" in done.stdout
    assert len(list(tmp_path.iterdir())) == 3
    done = process("render", mesh, "-o", tmp_path / "x.png", "--crop", "9,9,9000,9", env=environment)
    refused(done, "a part of 960")


@pytest.mark.skipif(os.name == "nt" or sys.platform == "darwin", reason="file names are UTF-8 there")
def test_file_names_that_are_no_text(tmp_path):
    strange = os.fsdecode(os.fsencode(tmp_path) + b"/\xff")
    trimesh.creation.box().export(tmp_path / "box.ply")
    (tmp_path / "box.ply").rename(strange + ".ply")
    done = succeeded("bake", strange + ".ply", "-o", strange + ".npy", "--report", strange + ".json", "--samples", 8)
    assert "\\udcff.npy: 8 vertices" in done.stdout
    for ending in (".png", ".exr"):
        size = ("--width", 8, "--height", 8, "--samples", 1)
        done = succeeded("render", strange + ".ply", "-o", strange + ending, *size)
        refused(obscurance("compare", strange + ending, strange + ending), "path in UTF-8")
    done = obscurance("bake", strange + ".ply", "-o", tmp_path / "a\x1b[31m.npy", "--samples", 8)
    assert "a\\x1b[31m.npy: 8 vertices" in done.stdout
    refused(
        obscurance("bake", strange + ".ply", "-o", tmp_path / "\x1b[31m" / "a.npy"), "\\x1b[31m/a.npy: cannot write"
    )
    os.mkdir(strange)
    refused(obscurance("render", strange + ".ply", "-o", strange + "/x.png"), "UTF-8")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_an_output_that_is_full_or_closed(tmp_path):
    from command import COMMAND

    with open("/dev/full", "w") as full:
        done = subprocess.run([*COMMAND, "scenes"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "obscurance: standard output: No space left on device\n")
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([*COMMAND, "scenes"], stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (1, "")
