"""Wavefront OBJ: exactly the `v` lines, whatever the faces say."""

import numpy as np
import pytest
from mesh_files import FACES, VERTICES, mistake, read

from obscurance.scenes.formats.load import load


def obj_with(faces, extra="", vertices=VERTICES):
    rows = ["v {} {} {}".format(*vertex) for vertex in vertices]
    return ("\n".join(rows) + f"\n{extra}\n{faces}\n").encode()


@pytest.mark.parametrize(
    "faces",
    [
        "f 1/1 2/2 4/3\nf 1/2 4/1 5/3\nf 3/1 6/1 4/2",
        "f 1/1/1 2/2/1 4/3/1\nf 1/2/1 4/1/1 5/3/1\nf 3/1/1 6/1/1 4/2/1",
        "f 1//1 2//1 4//1\nf 1//1 4//1 5//1\nf 3//1 6//1 4//1",
        "f 1//1 2//1 4//1\nf 1 4 5\nf 3//1 6//1 4//1",
        "usemtl a\nf 1 2 4\nusemtl b\nf 1 4 5\nusemtl a\nf 3 6 4",
        "o a\nf 1 2 4\no b\ng g\ns 1\nf 1 4 5\no a\nf 3 6 4",
        "f -7 -6 -4\nf -7 -4 -3\nf -5 -2 -4",
        "  f\t1 2 4 # one\r\nf 1 4 \\\n5\nf 3 6 4",
    ],
)
def test_obj_vertices_are_the_v_lines(tmp_path, faces):
    file = read(tmp_path, "m.obj", obj_with(faces, "mtllib missing.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1"))
    assert np.array_equal(file.mesh.vertices, VERTICES)
    assert np.array_equal(file.mesh.faces, FACES)
    assert len(file.parts) == 1


def test_obj_relative_indices_count_from_their_own_line(tmp_path):
    text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf -3//-1 -2//-1 -1//-1\nv 5 5 5\nvn 1 0 0\nf -1//-1 -3//-2 -2//-2\n"
    file = read(tmp_path, "m.obj", text)
    assert file.mesh.faces.tolist() == [[0, 1, 2], [3, 1, 2]]
    np.testing.assert_array_equal(file.mesh.normals, [[0, 0, 1]] * 3 + [[1, 0, 0]])


def test_obj_colours_beside_vertices_do_not_matter(tmp_path):
    file = read(tmp_path, "m.obj", b"v 0 0 0 nan nan nan\nv 1 0 0 .5 .5 .5\nv 0 1 0\nf 1 2 3\n")
    assert file.mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_obj_normals_where_each_vertex_has_one(tmp_path):
    normals = "vn 0 0 1\nvn 0 1 0\nvn 0 0 1"
    file = read(tmp_path, "m.obj", obj_with("f 1//1 2//2 4//3\nf 1//3 4//1 5//1", normals))
    np.testing.assert_array_equal(file.mesh.normals[[0, 1, 3, 4]], [[0, 0, 1], [0, 1, 0], [0, 0, 1], [0, 0, 1]])
    assert np.isnan(file.mesh.normals[[2, 5, 6]]).all()


@pytest.mark.parametrize("faces", ["f 1//1 2//1 4//1\nf 1//2 4//1 5//1", "f 1//1 2//1 4//1\nf 1 4 5", "f 1/1 2/1 4/1"])
def test_obj_normals_are_of_corners_where_vertices_have_several_or_corners_none(tmp_path, faces):
    mesh = read(tmp_path, "m.obj", obj_with(faces, "vn 0 0 1\nvn 0 1 0\nvt 0 0")).mesh
    assert mesh.normals is None
    if "//" not in faces:
        assert mesh.corner_normals is None
        return
    normals = {"1//1": [0, 0, 1], "2//1": [0, 0, 1], "4//1": [0, 0, 1], "5//1": [0, 0, 1], "1//2": [0, 1, 0]}
    expected = [[normals.get(word, [np.nan] * 3) for word in row.split()[1:]] for row in faces.split("\n")]
    np.testing.assert_array_equal(mesh.corner_normals.values[mesh.corner_normals.of], expected)
    turned = mesh.reversed().corner_normals
    np.testing.assert_array_equal(turned.values[turned.of], -np.array(expected)[:, ::-1])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("f 1 2 99", "v indices from 1 to 7, got 99"),
        ("f 0 1 2", "got 0"),
        ("f -8 -2 -1", "got 0"),
        ("f -1 -2 -99", "got -91"),
        ("f 1 2", "at least one triangle, got none, and 7 points"),
        ("f a b c", "got corners of faces that are no numbers"),
        ("v 1 2\nf 1 2 3", "three coordinates"),
        ("v 1 2 oops\nf 1 2 3", "got oops in line 9, which is no number"),
        ("v nan 0 0\nf 1 2 3", "finite coordinates"),
        ("f 1 2 99999999999999999999999", "indices from 1 to 7"),
        ("l 1 2", "at least one triangle, got none, and 7 points"),
    ],
)
def test_obj_mistakes(tmp_path, text, expected):
    assert expected in mistake(tmp_path, "m.obj", obj_with(text, "vn 0 0 1"))


def test_faces_of_two_corners_are_told_and_names_stay_with_their_faces(tmp_path):
    text = "usemtl a\nf 1 2\nf 1 2 3\nf\nusemtl b\nf 7\nf 1 3 4\nf 2 3\nusemtl c\nf 5 6 7 4"
    (tmp_path / "m.obj").write_bytes(obj_with(text))
    file = load(tmp_path / "m.obj", "m.glb")
    assert file.notes == (f"{tmp_path / 'm.obj'}: 4 faces of fewer than three corners are no triangles",)
    assert len(file.mesh.faces) == 4
    names = [file.materials[number].name for number in file.primitives[0].material]
    assert [name for name, size in zip(names, file.sizes, strict=True) if size > 2] == ["a", "b", "c"]


VT = ["vt 0 0", "vt 1", "vt .25 x", "vt nan 1", "vt", "vt .5 .75"]


@pytest.mark.parametrize("wrong", [2, 3, 4, 5, 7, 0, -9])
def test_corners_without_texture_coordinates_that_can_be_used_have_none(tmp_path, wrong):
    """Lines that are wrong keep their numbers, so that others are not taken for them."""
    (tmp_path / "m.obj").write_bytes(obj_with(f"f 1/1 2/6 3/6\nf 1/6 3/{wrong} 4/1", "\n".join(VT)))
    file = load(tmp_path / "m.obj", "m.glb")
    np.testing.assert_array_equal(file.uv, [[[0, 0], [0.5, 0.75], [0.5, 0.75]], np.full((3, 2), np.nan)])
    words = "texture coordinates of 1 corners are ignored: their vt are not two finite numbers"
    if wrong not in range(1, 7):
        words = "1 of 6 indices of vt are ignored: the file has 6 lines vt"
    assert file.notes == (f"{tmp_path / 'm.obj'}: {words}",)


@pytest.mark.parametrize("wrong", ["2", "3", "9"])
def test_corners_without_normals_that_can_be_used_have_those_of_faces(tmp_path, wrong):
    normals = "vn 0 0 1\nvn 0 1\nvn 0 1 z"
    (tmp_path / "m.obj").write_bytes(obj_with(f"f 1//1 2//1 3//{wrong}", normals))
    file = load(tmp_path / "m.obj")
    np.testing.assert_array_equal(file.mesh.normals[:3], [[0, 0, 1], [0, 0, 1], [np.nan] * 3])
    assert "1 of 3 normals at corners are missing, zero, not finite" in file.notes[-1]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_marks_of_encodings_are_heeded(tmp_path, encoding):
    text = obj_with("usemtl é\nf 1 2 3").decode().encode(encoding)
    (tmp_path / "m.obj").write_bytes(text)
    file = load(tmp_path / "m.obj", "m.glb")
    assert file.mesh.faces.tolist() == [[0, 1, 2]]
    assert [material.name for material in file.materials] == ["é"]
