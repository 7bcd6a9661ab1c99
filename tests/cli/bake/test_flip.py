"""`bake --flip`: faces of the input are turned over, in what is baked and in what is written."""

import json

import numpy as np
import pytest
from command import obscurance, refused, succeeded
from gltf_files import QUAD, TRIANGLE, Builder
from kept_contents import bake, columns
from mesh_files import ply
from PIL import Image

from obscurance import scenes
from obscurance.scenes.formats.load import load

HOUSE = """v -1 0 -1
v 1 0 -1
v 1 0 1
v -1 0 1
v -1 1 -1
v 1 1 -1
v 1 1 1
v -1 1 1
v 0 2 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 -1
f 1/1 2/2 3/3 4/4
f 1/1 5/2 6/3 2/4
f 2/1 6/2 7/3 3/4
f 3/1 7/2 8/3 4/4
f 4/1 8/2 5/3 1/4
f 5/1 9/2 6/3
f 6/1 9/2 7/3
f 7/1 9/2 8/3
f 8/1 9/2 5/3
"""


@pytest.mark.parametrize("ending", ["ply", "glb"])
def test_what_is_written_is_turned_over_with_its_corners(tmp_path, monkeypatch, ending):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "house.obj").write_text(HOUSE)
    straight, turned = f"straight.{ending}", f"turned.{ending}"
    for options, output in (((), straight), (("--flip",), turned)):
        succeeded("bake", "house.obj", "-o", output, "--samples", 64, *options)
    before, after = load(tmp_path / straight), load(tmp_path / turned)
    assert len(before.mesh.vertices) == len(after.mesh.vertices)
    corners = after.mesh.vertices[after.mesh.faces]
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    other = before.mesh.vertices[before.mesh.faces]
    assert volume == pytest.approx(-np.einsum("fi,fi->", other[:, 0], np.cross(other[:, 1], other[:, 2])))
    placed = {tuple(np.round([*p, *q], 6)) for p, q in zip(other.reshape(-1, 3), before.uv.reshape(-1, 2), strict=True)}
    found = {tuple(np.round([*p, *q], 6)) for p, q in zip(corners.reshape(-1, 3), after.uv.reshape(-1, 2), strict=True)}
    assert placed == found
    assert not np.allclose(before.w, after.w, atol=0.2)


def test_a_ply_keeps_its_properties_and_has_its_normals_negated(tmp_path):
    mesh = scenes.Box().geometry().mesh
    (tmp_path / "box.ply").write_bytes(ply(mesh.vertices, mesh.faces[:, ::-1]))
    report = tmp_path / "r.json"
    arguments = "bake", tmp_path / "box.ply", "-o", tmp_path / "w.ply", "--samples", 4, "--report", report
    assert "look inwards, so the inside is baked: --flip" in obscurance(*arguments).stderr
    found = json.loads(report.read_text())
    assert any("look inwards" in line for line in found["warnings"])
    assert not found["verdict"]["good"]
    assert "look inwards" in found["verdict"]["findings"][0]["what"]
    assert obscurance(*arguments, "--flip").stderr == ""
    assert "look inwards" not in report.read_text()
    assert np.array_equal(load(tmp_path / "w.ply").mesh.faces, mesh.faces)
    assert "look inwards" in obscurance("info", tmp_path / "box.ply").stdout


def test_a_gltf_keeps_its_faces_in_a_glb(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, TRIANGLE))
    (tmp_path / "m.glb").write_bytes(builder.glb([{"mesh": 0}]))
    refused(obscurance("bake", tmp_path / "m.glb", "-o", tmp_path / "w.glb", "--flip"), "bake --flip: expected another")
    succeeded("bake", tmp_path / "m.glb", "-o", tmp_path / "w.ply", "--flip", "--samples", 1)


def test_a_gltf_is_turned_over_into_an_image(tmp_path):
    """The inside of a cube whose faces look inwards is closed, its outside open; its normals are turned, too."""
    square = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], "<f4")
    builder = Builder()
    sides = [square, square[::-1] * [1, 1, -1]]
    sides += [np.roll(side, turn, axis=1) for side in sides for turn in (1, 2)]
    vertices = np.concatenate(sides).astype("<f4")
    faces = np.array([[0, 2, 1], [0, 3, 2]]) + 4 * np.arange(6)[:, None, None]
    outward = np.repeat([side.mean(axis=0) for side in sides], 4, axis=0)
    primitive = builder.primitive(vertices, faces, -outward)
    places = np.array([[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]])
    uv = (np.stack(np.divmod(np.arange(6), 2), axis=-1)[:, None] + places) / [3, 2]
    primitive["attributes"]["TEXCOORD_0"] = builder.accessor(uv.reshape(-1, 2).astype("<f4"), "VEC2")
    builder.mesh(primitive)
    (tmp_path / "m.glb").write_bytes(builder.glb([{"mesh": 0}]))
    image = "bake", tmp_path / "m.glb", "-o", tmp_path / "w.png", "--size", 32, "--samples", 16, "--falloff", "binary"
    for options, right in (((), 0), (("--flip",), 65535)):
        succeeded(*image, *options)
        assert abs(np.asarray(Image.open(tmp_path / "w.png")).astype(int) - right).max() < 300
    refused(obscurance(*image, "--flip", "--mesh-output", tmp_path / "o.glb"), "bake --flip: expected another")


def test_places_on_textures_of_a_ply_stay_with_their_corners(tmp_path):
    lists = "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0.5 1 1.5 2 2.5\n"
    (tmp_path / "m.ply").write_text(f"{head}element face 1\n{lists}end_header\n{body}")
    bake(tmp_path, "m.ply", "w.ply", "--flip")
    face = columns(tmp_path / "w.ply")[0]["face"]
    corners, places = face["vertex_indices"].values, face["texcoord"].values.reshape(3, 2)
    assert sorted(corners) == [0, 1, 2]
    assert list(corners) != [0, 1, 2]
    np.testing.assert_array_equal(places, np.stack([corners, corners + 0.5], axis=-1))
