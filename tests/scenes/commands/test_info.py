"""`obscurance info`: the same facts for people and, as JSON, for programs."""

import json

import pytest
from command import obscurance, refused
from mesh_files import VERTICES, obj, ply
from meshes import hills

from obscurance.raytrace import Mesh
from obscurance.scenes import MeshFile
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
    assert obscurance("bake", tmp_path / "hills.obj", "-o", tmp_path / "w.glb", "--samples", 64).returncode == 0
    found = json.loads(obscurance("info", tmp_path / "w.glb", "--json").stdout)
    assert 0 < found["stored_w"]["least"] < found["stored_w"]["mean"] < found["stored_w"]["largest"] <= 1
    assert found["stored_w"]["outside_0_to_1"] == 0
    assert found["occlusion_textures"] == {"primitives": 1, "textured": 1, "ramps": 1}


@pytest.mark.parametrize(("ending", "stored"), [("ply", "32-bit floats"), ("glb", "16-bit integers")])
def test_a_profile_is_described(tmp_path, ending, stored):
    (tmp_path / "hills.obj").write_bytes(obj(*hills(6)))
    baked = tmp_path / f"w.{ending}"
    done = obscurance("bake", tmp_path / "hills.obj", "-o", baked, "--samples", 4, "--profile")
    assert done.returncode == 0, done.stderr
    found = json.loads(obscurance("info", baked, "--json").stdout)
    lengths = found["stored_profile"]["half_distances"]
    assert len(lengths) == 10
    assert lengths[0] == pytest.approx(0.005 * found["radius"])
    rows = dict(line.split(maxsplit=1) for line in obscurance("info", baked).stdout.splitlines())
    assert rows["profile"].startswith("w at 10 half-distances, ")
    assert rows["profile"].endswith(f" (0.5 to 256 % of the radius), as {stored}")
    assert json.loads(obscurance("info", tmp_path / "hills.obj", "--json").stdout)["stored_profile"] is None


def test_standard_input_is_described(standard_input):
    standard_input(ply())
    found = json.loads(obscurance("info", "-", "--json").stdout)
    assert (found["file"], found["vertices"]) == ("<stdin>.ply", len(VERTICES))


@pytest.mark.parametrize("size", [1e-150, 1e150])
def test_any_size_is_json(size):
    file = MeshFile.of(Mesh(VERTICES * size, [[0, 1, 2]]))
    json.dumps(facts(file), allow_nan=False)
    assert dict(describe(file))["vertices"] == str(len(VERTICES))


def test_a_mistake_is_one_line_with_json_too(tmp_path):
    refused(obscurance("info", tmp_path / "none.ply", "--json"), "none.ply: file: expected an existing file")
