"""PLY files as other programs write and read them: ends of lines, strips of triangles, lists that MeshLab refuses."""

import struct

import numpy as np
import pytest
from command import obscurance, succeeded

from obscurance.scenes.formats.load import load

HEADER = """ply
format {format} 1.0
element vertex 5
property float x
property float y
property float z
element {element}
end_header
"""
VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [10, 10, 10]], "<f4")  # 10: an end of a line
QUADS = """ply
format ascii 1.0
element vertex 6
property float x
property float y
property float z
element face 3
property list uchar int vertex_indices
property list uchar float texcoord
property uchar tag
end_header
0 0 0
1 0 0
1 1 0
0 1 0
2 0 0
2 1 0
4 0 1 2 3 8 0 0 1 0 1 1 0 1 7
4 1 4 5 2 8 .5 .25 1 0 1 1 0 1 8
3 0 1 2 6 0 0 .1 .2 .3 .4 9
"""


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("text", [True, False])
def test_lines_of_a_header_may_end_in_any_way(tmp_path, standard_input, end, text):
    element = "face 1\nproperty list uchar int vertex_index"
    header = HEADER.format(format="ascii" if text else "binary_little_endian", element=element).replace("\n", end)
    rows = "".join("{} {} {}\n".format(*row) for row in VERTICES.astype(int).tolist()) + "3 0 1 2\n"
    rest = (
        rows.replace("\n", end).encode()
        if text
        else VERTICES[[4, *range(4)]].tobytes() + b"\3" + struct.pack("<3i", 1, 2, 3)
    )
    (tmp_path / "m.ply").write_bytes(header.encode() + rest)
    mesh = load(tmp_path / "m.ply").mesh
    np.testing.assert_array_equal(mesh.vertices, VERTICES if text else VERTICES[[4, *range(4)]])
    np.testing.assert_array_equal(mesh.vertices[mesh.faces[0]], VERTICES[:3])
    standard_input((tmp_path / "m.ply").read_bytes())
    succeeded("info", "-")


@pytest.mark.parametrize(
    ("lists", "faces"),
    [
        ([[0, 1, 2, 3, 4]], [[0, 1, 2], [3, 2, 1], [2, 3, 4]]),
        ([[0, 1, 2, -1, 1, 3, 2, 4, -1, 4, 3]], [[0, 1, 2], [1, 3, 2], [4, 2, 3]]),
        ([[0, 1, 2, 3], [1, 3, 2]], [[0, 1, 2], [3, 2, 1], [1, 3, 2]]),
        ([[], [-1, 2, 1, 0], [3, 4]], [[2, 1, 0]]),
    ],
)
@pytest.mark.parametrize("text", [True, False])
def test_strips_of_triangles_are_faces(tmp_path, text, lists, faces):
    element = f"tristrips {len(lists)}\nproperty list int int vertex_indices"
    header = HEADER.format(format="ascii" if text else "binary_little_endian", element=element)
    rows = "".join("{} {} {}\n".format(*row) for row in VERTICES.tolist()) + "".join(
        " ".join(map(str, [len(one), *one])) + "\n" for one in lists
    )
    binary = VERTICES.tobytes() + b"".join(struct.pack(f"<{len(one) + 1}i", len(one), *one) for one in lists)
    (tmp_path / "m.ply").write_bytes(header.encode() + (rows.encode() if text else binary))
    assert load(tmp_path / "m.ply").mesh.faces.tolist() == faces
    bake = "bake", tmp_path / "m.ply", "-o", tmp_path / "w.ply", "--samples", 1
    succeeded(*bake)
    assert load(tmp_path / "w.ply").mesh.faces.tolist() == faces
    succeeded(*bake, "--at", "faces")
    kept = load(tmp_path / "w.ply", "k.ply")
    (face,) = (element for element in kept.raw.elements if element.name == "face")
    assert "obscurance" in [column.name for column in face.properties]


def obj_of_quads(folder):
    """The same as `QUADS`: the sides of the edge from 1 to 2 have other coordinates."""
    rows = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "v 2 0 0", "v 2 1 0", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    rows += ["vt .5 .25", "vt .1 .2", "vt .3 .4", "f 1/1 2/2 3/3 4/4", "f 2/5 5/2 6/3 3/4", "f 1/1 2/6 3/7"]
    (folder / "q.obj").write_text("\n".join(rows))
    return folder / "q.obj"


def ply_of_quads(folder):
    (folder / "q.ply").write_text(QUADS)
    return folder / "q.ply"


@pytest.mark.parametrize("make", [obj_of_quads, ply_of_quads])
@pytest.mark.parametrize("at", ["vertices", "faces"])
def test_meshlab_gets_triangles_where_it_opens_no_polygons(tmp_path, make, at):
    """MeshLab says "Face with more than 3 vertices" of polygons with texcoord; as triangles they have the same."""
    path = make(tmp_path)
    before = load(path, "k.ply")
    line = "bake", path, "-o", tmp_path / "w.ply", "--samples", 1, *(["--at", "faces"] if at == "faces" else [])
    done = succeeded(*line, "--preset", "meshlab")
    assert "polygons, which become triangles" in done.stderr
    after = load(tmp_path / "w.ply", "k.ply")
    assert after.sizes.tolist() == [3] * 5
    np.testing.assert_array_equal(after.mesh.faces, before.mesh.faces)
    np.testing.assert_allclose(after.uv, before.uv, rtol=1e-7)
    (face,) = (element for element in after.raw.elements if element.name == "face")
    columns = {column.name: column.values.tolist() for column in face.properties}
    assert columns.get("tag", [7, 7, 8, 8, 9]) == [7, 7, 8, 8, 9]
    assert ("quality" in columns) == (at == "faces")
    plain = obscurance(*line)
    assert "polygons" not in plain.stderr
    assert load(tmp_path / "w.ply", "k.ply").sizes.tolist() == [4, 4, 3]


def test_meshlab_gets_polygons_where_it_opens_them(tmp_path):
    (tmp_path / "q.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nf 1/1 2/2 3/1 4/2\n")
    done = obscurance("bake", tmp_path / "q.obj", "-o", tmp_path / "w.ply", "--samples", 1, "--preset", "meshlab")
    assert done.stderr == ""
    assert load(tmp_path / "w.ply", "k.ply").sizes.tolist() == [4]


@pytest.mark.parametrize("kind", ["uchar uint", "uchar ushort", "uchar uchar", "ushort int", "uint int"])
def test_meshlab_gets_indices_that_it_opens(tmp_path, kind):
    """MeshLab says "Bad vertex index in face" of these."""
    (tmp_path / "q.ply").write_text(QUADS.replace("uchar int vertex_indices", f"{kind} vertex_index"))
    for preset, declared in ((), f"{kind} vertex_index\n"), (("--preset", "meshlab"), "uchar int vertex_indices\n"):
        succeeded("bake", tmp_path / "q.ply", "-o", tmp_path / "w.ply", "--samples", 1, *preset)
        assert f"property list {declared}".encode() in (tmp_path / "w.ply").read_bytes()
        assert load(tmp_path / "w.ply").mesh.faces.tolist() == load(tmp_path / "q.ply").mesh.faces.tolist()


def test_meshlab_gets_triangles_of_polygons_of_many_corners(tmp_path):
    """Of a polygon of 256 corners MeshLab shows one triangle."""
    for corners, sizes in ((255, [255]), (256, [3] * 254)):
        angles = 2 * np.pi * np.arange(corners) / corners
        rows = [f"v {x!r} {y!r} 0" for x, y in zip(np.cos(angles).tolist(), np.sin(angles).tolist(), strict=True)]
        (tmp_path / "q.obj").write_text("\n".join([*rows, " ".join(map(str, ["f", *range(1, corners + 1)]))]))
        succeeded("bake", tmp_path / "q.obj", "-o", tmp_path / "w.ply", "--samples", 1, "--preset", "meshlab")
        assert load(tmp_path / "w.ply").sizes.tolist() == sizes
