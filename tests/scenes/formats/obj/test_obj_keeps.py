"""What an .obj keeps of an .obj, and of files of other formats: names, normals and coordinates of corners."""

import numpy as np
import pytest
from command import obscurance, succeeded
from fuzz_seeds import FACES, VERTICES, ascii_stl

from obscurance.scenes import load

OBJ = """mtllib paint.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
vt .25 .5
vt 1 0
vt 0 nan
vn 0 0 1
vn 0 1 0
vn x
o table
g top
usemtl red
s 1
f 1/1/1 2/2/1 3/1/1 4/2/1
g leg
s off
f 1/1/2 5//2 2/2/2
o chair
usemtl blue
f 1//2 4/3/3 5//
"""


@pytest.fixture
def kept(tmp_path):
    (tmp_path / "m.obj").write_text(OBJ)
    (tmp_path / "paint.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    done = succeeded("bake", tmp_path / "m.obj", "-o", tmp_path / "w.obj", "--samples", 4)
    return load(tmp_path / "m.obj", "k.ply"), load(tmp_path / "w.obj", "k.ply"), done.stderr


def test_names_of_objects_groups_materials_and_smoothing_stay_before_their_faces(kept, tmp_path):
    before, after, printed = kept
    lines = (tmp_path / "w.obj").read_text().split("\n")
    named = [
        line.partition(" ")[0] if line.startswith("f ") else line for line in lines if line[:1] in "fogsum" and line
    ]
    assert named == [
        *("mtllib paint.mtl", "o table", "g top", "usemtl red", "s 1", "f"),
        *("g leg", "s off", "f", "o chair", "usemtl blue", "f"),
    ]
    assert after.objects == before.objects == ("table", "chair")
    assert [material.colour for material in after.materials] == [(1, 0, 0), (0, 0, 1)]
    assert after.primitives[0].material.tolist() == before.primitives[0].material.tolist() == [0, 0, 1]
    assert "not kept" not in printed


def test_corners_keep_their_coordinates_and_normals_or_have_none(kept):
    before, after, _ = kept
    np.testing.assert_array_equal(after.uv, before.uv)
    assert np.isnan(after.uv).any(axis=(1, 2)).tolist() == [False, False, True, True]
    assert after.mesh.corner_normals
    for values, of in (before.mesh.corner_normals, after.mesh.corner_normals):
        normals = values[of]
        assert normals[0].tolist() == [[0, 0, 1]] * 3
        assert normals[2].tolist() == [[0, 1, 0]] * 3
        assert np.isnan(normals[3, 1:]).all()
    assert not [line for line in after.notes if "ignored" in line]


def test_flipped_faces_keep_the_names_of_their_own(tmp_path, kept):
    succeeded("bake", tmp_path / "m.obj", "-o", tmp_path / "f.obj", "--samples", 4, "--flip")
    before, after = load(tmp_path / "m.obj"), load(tmp_path / "f.obj")
    assert after.objects == ("table", "chair")
    assert after.corners[:4].tolist() == before.corners[3::-1].tolist()
    np.testing.assert_array_equal(after.uv[2], before.uv[2, ::-1])


def test_objects_of_another_format_are_named(tmp_path):
    (tmp_path / "m.stl").write_bytes(ascii_stl(("a", VERTICES[FACES]), ("b c", VERTICES[FACES] + 3)))
    done = obscurance("bake", tmp_path / "m.stl", "-o", tmp_path / "w.obj", "--samples", 4, "-q")
    assert (done.returncode, done.stderr) == (0, "")
    assert load(tmp_path / "w.obj").objects == ("a", "b c")
