"""Files that are damaged or that claim what they have not: one line and status 2, or the right result."""

import json
import struct
import subprocess
import sys

import numpy as np
import pytest
from command import obscurance, refused, succeeded
from gltf_files import TRIANGLE, Builder
from mesh_files import obj
from meshes import hills
from project import environment


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(6)))
    (tmp_path / "line.obj").write_bytes(obj(np.outer(np.arange(4.0), (1, 0, 0)), np.array([[0, 1, 2], [0, 1, 3]])))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_lengths_that_vanish_are_refused(folder):
    bake = "bake", "hills.obj", "-o", "w.npz", "--max-distance"
    for method in ("vertex", "surface"):
        refused(obscurance(*bake, "5e-324", "--method", method), "bake --max-distance: expected a length above 0")
    succeeded(*bake, "1e-307", "--samples", 16)
    assert (np.load("w.npz")["w"] == 1).all()


@pytest.mark.parametrize("inputs", ["a", ["a"], [1], 3, {"output": 3}])
def test_inputs_of_a_report_that_are_none_are_ignored(folder, inputs):
    (folder / "r.json").write_text(json.dumps({"options": {"occlusion": "none", "samples": 4}, "inputs": inputs}))
    succeeded("bake", "hills.obj", "-o", "w.glb", "--options", "r.json")


@pytest.mark.parametrize("name", ["mesh", "occluder", "receive", "high"])
def test_options_of_a_report_that_are_no_lists_are_refused(folder, name):
    (folder / "r.json").write_text(json.dumps({"options": {name: 3}}))
    refused(obscurance("bake", "hills.obj", "-o", "w.npz", "--options", "r.json"), f"options.{name}: expected a list")


HEADERS = {
    "open": b"{'descr': \x1b[31mevil\x07\n",
    "with a warning of Python's": b"{'descr': '<f8', 'fortran_order': False, 'shape': (3\x1b if 0 else 4, 2), }\n",
    "with an escape": b"{'descr': '\x1b\\d<f8', 'fortran_order': False, 'shape': (3, 2), }\n",
    "of Python 2": b"{'descr': '<f8', 'fortran_order': False, 'shape': (3L, 2), }\n",
    "of many levels": b"(" * 3000,
    "of many terabytes": b"{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000000, 2), }\n",
}


@pytest.mark.parametrize("name", HEADERS)
def test_arrays_with_damaged_headers_are_refused(folder, name):
    header = HEADERS[name]
    (folder / "d.npy").write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(48))
    for command in ("bake hills.obj -o w.npz --falloff table:d.npy", "view d.npy --mesh hills.obj"):
        result = obscurance(*command.split())
        refused(result, "d.npy: ")
        assert result.stderr[:-1].isprintable()


def test_complex_numbers_are_refused(folder):
    count, half_distances = 36, np.arange(1.0, 11.0)
    np.savez("p.npz", w=np.ones(count), profile=np.ones((count, 10)) + 1j, half_distances=half_distances, radius=1.0)
    np.save("t.npy", np.array([[0, 0], [1, 1]], complex))
    refused(obscurance("falloff", "p.npz", "--half-distance", 3, "-o", "x.npz"), "p.npz: profile: expected")
    refused(obscurance("bake", "hills.obj", "--falloff", "table:t.npy", "-o", "x.npz"), "t.npy: content: expected")


@pytest.mark.parametrize("number", ["-Infinity", "NaN", "1e999"])
def test_a_glb_with_what_is_no_number_in_json_is_refused(folder, number):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE))
    (folder / "a.glb").write_bytes(builder.glb([{"mesh": 0, "extras": {"a": "@" * (len(number) - 2)}}]))
    succeeded("bake", "a.glb", "-o", "w.glb", "--samples", 4)
    content = (folder / "a.glb").read_bytes()
    (folder / "a.glb").write_bytes(content.replace(b'"' + b"@" * (len(number) - 2) + b'"', number.encode()))
    refused(
        obscurance("bake", "a.glb", "-o", "x.glb"),
        f"a.glb: content: expected a complete and valid GLB file, got {number}",
    )


def box(name, content):
    return struct.pack(">I4s", 8 + len(content), name) + content


def jpeg_2000(side):
    """A picture that has a header and nothing else."""
    size = struct.pack(">HIIIIIIIIH", 0, side, side, 0, 0, side, side, 0, 0, 3) + b"\x07\x01\x01" * 3
    code = b"\xff\x4f\xff\x51" + struct.pack(">H", len(size) + 2) + size
    code += b"\xff\x52" + struct.pack(">HBBHBBBBBB", 12, 0, 0, 1, 0, 5, 4, 4, 0, 1)
    code += b"\xff\x5c" + struct.pack(">HB", 19, 64) + b"\x40" * 16
    code += b"\xff\x90" + struct.pack(">HHIBB", 10, 0, 0, 0, 1) + b"\xff\x93" + bytes(500) + b"\xff\xd9"
    header = box(b"ihdr", struct.pack(">IIHBBBB", side, side, 3, 7, 7, 0, 0)) + box(b"colr", b"\1\0\0\0\0\0\x10")
    begin = box(b"jP  ", b"\r\n\x87\n") + box(b"ftyp", b"jp2 \0\0\0\0jp2 ")
    return code, begin + box(b"jp2h", header) + box(b"jp2c", code)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="kilobytes of ru_maxrss")
@pytest.mark.parametrize("form", [0, 1])
def test_a_picture_that_claims_much_is_refused_by_its_header(folder, form):
    (folder / "a.jp2").write_bytes(jpeg_2000(8000)[form])
    begin = "import os, sys; from obscurance.raytrace.image.read import open_image; import OpenImageIO, resource\n"
    peak = "resource.getrusage(resource.RUSAGE_SELF).ru_maxrss"
    code = f"{begin}before = {peak}\ntry: open_image('a.jp2')\nexcept ValueError as e: print({peak} - before, e)"
    result = subprocess.run([sys.executable, "-c", code], env=environment(), capture_output=True, text=True, check=True)
    grown, _, said = result.stdout.partition(" ")
    assert said.startswith("a.jp2: size: expected pixels that ")
    assert int(grown) < 32 << 10
    (folder / "b.jp2").write_bytes(jpeg_2000(500)[form])
    succeeded("compare", "b.jp2", "b.jp2")
