"""Mesh files of one object: every vertex as stored, at little cost."""

import struct
import subprocess
import sys

import numpy as np
import pytest
from mesh_files import (
    FACES,
    MIXED,
    MIXED_FANS,
    NORMALS,
    VERTICES,
    ascii_ply,
    ascii_stl,
    mistake,
    mixed_ply,
    obj,
    off,
    ply,
    read,
    stl,
)
from meshes import hills


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("m.ply", ply()),
        ("m.PLY", ply(order=">")),
        ("texture.ply", ply(uv=np.arange(14).reshape(7, 2))),
        ("ascii.ply", ascii_ply()),
        ("m.off", off()),
        ("latin.off", off().replace(b"made for", b"f\xfcr")),
        ("m.obj", obj()),
    ],
)
def test_indexed_formats_give_the_stored_vertices(tmp_path, name, data):
    file = read(tmp_path, name, data)
    assert np.array_equal(file.mesh.vertices, VERTICES)
    assert np.array_equal(file.mesh.faces, FACES)
    assert file.mesh.vertices.dtype == np.float64
    assert file.mesh.normals is None
    (part,) = file.parts
    assert (part.name, part.vertices, part.faces) == (name.split(".")[0], slice(0, 7), slice(0, 3))
    assert file.mesh.source == str(file.path) == str(tmp_path / name)


@pytest.mark.parametrize("format", ["binary", "ascii", "latin", "two solids"])
def test_stl_gives_three_vertices_a_face(tmp_path, format):
    triangles = VERTICES[FACES]
    data = {
        "binary": stl(triangles),
        "ascii": ascii_stl(("one", triangles)),
        "latin": ascii_stl(("one", triangles)).replace(b"one", b"\xfcber"),
        "two solids": ascii_stl(("one", triangles[:1]), ("two", triangles[1:])),
    }[format]
    file = read(tmp_path, "m.stl", data)
    assert np.array_equal(file.mesh.vertices, triangles.reshape(-1, 3))
    assert np.array_equal(file.mesh.faces, np.arange(9).reshape(-1, 3))
    if format == "two solids":
        assert [part.name for part in file.parts] == ["one", "two"]
        assert file.parts[1].vertices == slice(3, 9)


@pytest.mark.parametrize("write", [ply, ascii_ply, off, obj])
def test_quads_become_two_triangles(tmp_path, write):
    file = read(tmp_path, f"m.{write.__name__.split('_')[-1]}", write(VERTICES, [[0, 1, 3, 4]]))
    assert np.array_equal(file.mesh.vertices, VERTICES)
    assert {frozenset(face) for face in file.mesh.faces.tolist()} == {frozenset({0, 1, 3}), frozenset({0, 3, 4})}


def test_mixed_polygons_become_fans_in_order(tmp_path):
    assert read(tmp_path, "m.obj", obj(VERTICES, MIXED)).mesh.faces.tolist() == MIXED_FANS


def test_ply_normals(tmp_path):
    file = read(tmp_path, "m.ply", ply(normals=NORMALS))
    np.testing.assert_allclose(file.mesh.normals, NORMALS, atol=1e-7)


@pytest.mark.parametrize("order", "<>")
def test_binary_ply_with_mixed_polygons(tmp_path, order):
    file = read(tmp_path, "m.ply", mixed_ply(order))
    assert np.array_equal(file.mesh.vertices, VERTICES)
    assert file.mesh.faces.tolist() == MIXED_FANS
    np.testing.assert_allclose(file.mesh.normals, NORMALS, atol=1e-7)


def test_mixed_polygons_as_long_as_even_ones(tmp_path):
    data = mixed_ply()
    data = data[: data.rindex(b"end_header\n") + 11 + len(VERTICES) * 36]
    for polygon in ([0, 1, 5, 3], [0, 1, 3], [0, 1, 5, 3, 4]):
        data += struct.pack(f"<BB{len(polygon)}iB2f", 7, len(polygon), *polygon, 2, 0.5, 0.5)
    faces = [[0, 1, 5], [0, 5, 3], [0, 1, 3], [0, 1, 5], [0, 5, 3], [0, 3, 4]]
    assert read(tmp_path, "m.ply", data).mesh.faces.tolist() == faces


PEAK = """
import sys
from obscurance.scenes.formats import load
asked = []
load.check_memory = lambda path, size, work: asked.append(size)
def peak():
    return next(int(line.split()[1]) << 10 for line in open("/proc/self/status") if line.startswith("VmHWM"))
load.load(sys.argv[1])
before = peak()
assert len(load.load(sys.argv[2]).mesh.faces) == 498002
print((peak() - before) / asked[1])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_reading_takes_no_more_memory_than_is_asked_for(tmp_path):
    """And no less than half of it, where vertices have more than their place."""
    vertices, faces = hills(500)
    (tmp_path / "m.ply").write_bytes(ply(vertices, faces, normals=vertices, uv=vertices[:, :2]))
    (tmp_path / "small.ply").write_bytes(ply())
    command = [sys.executable, "-c", PEAK, tmp_path / "small.ply", tmp_path / "m.ply"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert 0.5 < float(done.stdout) < 1


@pytest.mark.parametrize(
    ("header", "row", "has_normals"),
    [
        ("OFF\n", "{} {} {}", False),
        ("OFF 7 3 0\n", "{} {} {}", False),
        ("COFF\n", "{} {} {} 255 0 0 255", False),
        ("NOFF # with normals\n", "{} {} {} 0 .6 .8", True),
        ("STCNOFF\r\n", "{} {} {} 0 .6 .8 1 0 0 1 .5 .5", True),
    ],
)
def test_variants_of_off(tmp_path, header, row, has_normals):
    rows = [row.format(*vertex) for vertex in VERTICES] + ["3 0 1 3", "3 0 3 4 # last", "3 2 5 3"]
    counts = "" if "7 3" in header else "7 3 0\n"
    file = read(tmp_path, "m.off", (header + counts + "\n".join(rows)).encode())
    assert np.array_equal(file.mesh.vertices, VERTICES)
    assert np.array_equal(file.mesh.faces, FACES)
    assert (file.mesh.normals is not None) == has_normals
    if has_normals:
        assert np.array_equal(file.mesh.normals, NORMALS)
    if "C" in header:
        np.testing.assert_array_equal(file.columns("color")[0].values[0, :3], [1, 0, 0])
        assert not file.unread
    assert (file.uv is not None) == ("ST" in header)


@pytest.mark.parametrize("row", ["{} {} {} 3", "{} {} {} -1 0 0", "{} {} {} 0 0 256", "{} {} {}"])
def test_colours_of_off_that_are_none_are_left_out(tmp_path, row):
    rows = [row.format(*vertex) for vertex in VERTICES] + ["3 0 1 3", "3 0 3 4", "3 2 5 3"]
    file = read(tmp_path, "m.off", ("COFF\n7 3 0\n" + "\n".join(rows)).encode())
    assert file.unread == ("colours",)
    assert not file.columns("color")


@pytest.mark.parametrize("header", ["4OFF", "nOFF", "OFF BINARY", "off", "PLY OFF"])
def test_other_variants_of_off_are_refused(tmp_path, header):
    assert "OFF file" in mistake(tmp_path, "m.off", off().replace(b"OFF", header.encode(), 1))
