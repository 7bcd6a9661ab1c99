"""`obscurance info`: the same facts for people and, as JSON, for programs."""

import json

import numpy as np
import pytest
from command import obscurance, refused, succeeded
from gltf_samples import picture, transformed
from mesh_files import VERTICES, obj, ply
from meshes import hills

from obscurance.raytrace import Mesh
from obscurance.scenes import Asset, Box
from obscurance.scenes.commands.info import describe, facts


def test_json_holds_what_the_text_says(tmp_path):
    path = tmp_path / "hills.obj"
    path.write_bytes(obj(*hills(6)))
    found = json.loads(obscurance("info", path, "--json").stdout)
    assert (found["vertices"], found["faces"], found["open_edges"]) == (36, 50, 20)
    assert (found["normals"], found["stored_w"], found["occlusion_textures"]) == (False, None, None)
    rows = dict(line.split(maxsplit=1) for line in obscurance("info", path).stdout.splitlines())
    assert rows["vertices"] == "36"
    assert rows["radius"].startswith(f"{found['radius']:.6g}, ")


def test_json_reports_w_that_a_bake_has_left(tmp_path):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(6)))
    succeeded("bake", tmp_path / "hills.obj", "-o", tmp_path / "w.glb", "--samples", 64)
    found = json.loads(obscurance("info", tmp_path / "w.glb", "--json").stdout)
    assert 0 < found["stored_w"]["least"] < found["stored_w"]["mean"] < found["stored_w"]["largest"] <= 1
    assert found["stored_w"]["outside_0_to_1"] == 0
    assert found["occlusion_textures"] == {"primitives": 1, "textured": 1, "ramps": 1}


@pytest.mark.parametrize(("ending", "stored"), [("ply", "32-bit floats"), ("glb", "16-bit integers")])
def test_a_profile_is_described(tmp_path, ending, stored):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(6)))
    baked = tmp_path / f"w.{ending}"
    succeeded("bake", tmp_path / "hills.obj", "-o", baked, "--samples", 4, "--profile")
    found = json.loads(obscurance("info", baked, "--json").stdout)
    lengths = found["stored_profile"]["half_distances"]
    assert len(lengths) == 10
    assert lengths[0] == pytest.approx(0.005 * found["radius"])
    rows = dict(line.split(maxsplit=1) for line in obscurance("info", baked).stdout.splitlines())
    assert rows["profile"].startswith("w at 10 half-distances, ")
    assert rows["profile"].endswith(f" (0.5 to 256 % of the radius), as {stored}")
    assert json.loads(obscurance("info", tmp_path / "hills.obj", "--json").stdout)["stored_profile"] is None


@pytest.mark.parametrize(("left_out", "expected"), [(0, (18432, 0)), (1, (18432, 3))])
def test_open_edges_of_an_stl_are_counted_as_the_bake_sees_them(tmp_path, left_out, expected):
    mesh = Box().geometry().mesh
    triangles = mesh.vertices[mesh.faces[left_out:]].astype("<f4")
    rows = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"] = triangles
    (tmp_path / "box.stl").write_bytes(bytes(80) + len(rows).to_bytes(4, "little") + rows.tobytes())
    found = json.loads(obscurance("info", tmp_path / "box.stl", "--json").stdout)
    assert found["vertices"] == 3 * len(rows)
    assert (found["edges"], found["open_edges"]) == expected


def test_an_edge_without_a_length_is_none():
    """Of a face with two corners at one place."""
    found = facts(Asset.of(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]], [[0, 1, 2], [0, 3, 1]])))
    assert (found["edges"], found["open_edges"], found["edges_of_three_faces_or_more"]) == (3, 2, 1)


def test_what_surfaces_have_is_listed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "two.glb").write_bytes(transformed())
    found = json.loads(obscurance("info", "two.glb", "--json").stdout)
    assert (found["texture_sets"], found["materials"], found["textures"]) == (2, ["material 0"], ["image/png"])
    (tmp_path / "wall.mtl").write_text("newmtl brick\nmap_Kd brick.png\nnewmtl moss\n")
    (tmp_path / "brick.png").write_bytes(picture())
    (tmp_path / "wall.obj").write_text(
        "mtllib wall.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nvn 0 1 1\n"
        "usemtl brick\nf 1/1/1 2/1/1 3/1/1\nusemtl moss\nf 1/1/2 3/1/2 4/1/2\n"
    )
    found = json.loads(obscurance("info", "wall.obj", "--json").stdout)
    assert (found["texture_sets"], found["materials"], found["textures"]) == (1, ["brick", "moss"], ["brick.png"])
    assert found["normals_at_corners"]
    said = " ".join(obscurance("info", "wall.obj").stdout.split())
    assert "normals in the file, several at some vertices texture sets 1 of texture coordinates" in said
    assert "materials 2: brick, moss textures 1: brick.png" in said
    succeeded("bake", "wall.obj", "-o", "w.glb", "--samples", 1)
    baked = json.loads(obscurance("info", "w.glb", "--json").stdout)
    assert (baked["texture_sets"], baked["materials"][1:], baked["textures"][0]) == (1, ["brick", "moss"], "brick.png")


def test_standard_input_is_described(standard_input):
    standard_input(ply())
    found = json.loads(obscurance("info", "-", "--json").stdout)
    assert (found["file"], found["vertices"]) == ("<stdin>.ply", len(VERTICES))


@pytest.mark.parametrize("size", [1e-150, 1e150])
def test_any_size_is_json(size):
    file = Asset.of(Mesh(VERTICES * size, [[0, 1, 2]]))
    json.dumps(facts(file), allow_nan=False)
    assert dict(describe(file))["vertices"] == str(len(VERTICES))


def test_a_mistake_is_one_line_with_json_too(tmp_path):
    refused(obscurance("info", tmp_path / "none.ply", "--json"), "none.ply: file: expected an existing file")
