"""One small case for each fault of the glTF reader that fuzzing or its preparation found: evidence/reliability.md."""

import json

import numpy as np
import pytest
from found_faults import baked, scene_mistake, triangle
from gltf_files import TRIANGLE, Builder, change
from mesh_files import mistake, read

from obscurance import ao
from obscurance.scenes.commands.info import describe
from obscurance.scenes.formats.gltf.asset import decode
from obscurance.scenes.formats.gltf.builder import GlbBuilder
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.write import write


def test_one_gltf_array_is_not_placed_without_end(tmp_path):
    triangles = Builder()
    triangles.mesh(triangles.primitive(np.tile(TRIANGLE, (50_000, 1))))
    assert len(read(tmp_path, "m.glb", triangles.glb([{"mesh": 0}] * 2)).parts) == 2
    message = mistake(tmp_path, "m.glb", triangles.glb([{"mesh": 0}] * 101))
    assert "objects: expected at most 20,000,000 vertices and triangles with all copies, got 20,200,000" in message


def test_a_large_gltf_may_place_as_much_as_it_stores(tmp_path):
    triangles = Builder()
    triangles.mesh(triangles.primitive(np.tile(TRIANGLE, (50_000, 1))))
    triangles.binary += bytes(20_200_000 - len(triangles.binary))
    message = mistake(tmp_path, "m.glb", triangles.glb([{"mesh": 0}] * 102))
    assert "objects: expected at most 20,200,000 vertices and triangles with all copies, got 20,400,000" in message


@pytest.mark.parametrize("stride", [4, 8])
def test_overlapping_gltf_rows_are_refused(tmp_path, stride):
    builder = triangle()
    builder.header["bufferViews"][0]["byteStride"] = stride
    assert "does not fit" in mistake(tmp_path, "m.glb", builder.glb([{"mesh": 0}]))


def test_gltf_buffers_of_one_file_are_read_once(tmp_path, watch):
    calls = watch("pathlib.Path.read_bytes")
    builder = triangle()
    (tmp_path / "m.bin").write_bytes(builder.binary)
    names = ["m.bin", "./m.bin", "x/../m.bin"] * 5
    header = builder.gltf([{"mesh": 0}])
    header["buffers"] = [header["buffers"][0] | {"uri": name} for name in names]
    (tmp_path / "m.gltf").write_text(json.dumps(header))
    (tmp_path / "x").mkdir()
    load(tmp_path / "m.gltf")
    assert [path.name for (path,) in calls].count("m.bin") == 1


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"nodes/0/mesh": "0"}, 'nodes[0].mesh: expected a whole number, 0 or more, got "0"'),
        ({"nodes/0/mesh": -1}, "nodes[0].mesh: expected a whole number, 0 or more, got -1"),
        ({"nodes/0/matrix": [0, 1]}, "nodes[0].matrix[2]: expected a value, got nothing"),
        ({"bufferViews/0/byteOffset": -4}, "bufferViews[0].byteOffset"),
        ({"bufferViews/0/buffer": 9}, "there is no buffers[9]"),
        ({"accessors/0/bufferView": 9}, "there is no bufferViews[9]"),
        ({"accessors/0/type": "MAT4"}, "accessors[0]: expected VEC3"),
        ({"accessors/0/count": 1e300}, "accessors[0].count: expected a whole number"),
        ({"scene": 9}, "there is no scenes[9]"),
        ({"nodes": [1] * 1000}, "nodes[0]: expected an object, got 1"),
        ({"materials": [{"emissiveFactor": "x"}]}, "materials[0].emissiveFactor: expected"),
        (
            {"textures": [{"source": None}]},
            "textures[0].source: expected a whole number, 0 or more, got",
        ),
        ({"cameras": [{"type": "x" * 5000}]}, "cameras[0].type: expected one of perspective"),
        (
            {"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 1]}}]},
            "materials[0].pbrMetallicRoughness.baseColorFactor[2]: expected a value, got nothing",
        ),
    ],
)
def test_gltf_faults_have_a_path(tmp_path, changes, expected):
    builder = triangle()
    builder.header |= {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    change(builder.header, changes)
    content = builder.glb(builder.header["nodes"], **{"scenes": builder.header["scenes"]})
    assert expected in scene_mistake(tmp_path, content, "m.glb")


def test_gltf_names_that_are_no_text(tmp_path):
    """JSON can write half a character; a GLB file keeps it."""
    file = read(tmp_path, "m.glb", triangle().glb([{"mesh": 0, "name": "\ud800"}]))
    write(tmp_path / "w.glb", baked(3), file)
    assert [part.name for part in load(tmp_path / "w.glb").parts] == ["\ud800"]
    assert ("objects", r"1: \ud800") in describe(file)


def test_a_material_that_is_refused_is_named(tmp_path):
    builder = triangle()
    builder.header["meshes"][0]["primitives"][0]["material"] = 0
    materials = [{"emissiveFactor": [-1, 0, 0]}]
    message = scene_mistake(tmp_path, builder.glb([{"mesh": 0}], materials=materials), "m.glb")
    assert "m.glb: materials[0].emission[0]: expected a number in [0, inf), got -1" in message


def test_a_view_of_no_buffer_that_nothing_uses_is_written(tmp_path):
    path = tmp_path / "m.glb"
    asset = decode(triangle().glb([{"mesh": 0}]), path)
    asset.header["bufferViews"].append({"buffer": 7, "byteLength": 4})
    path.write_bytes(GlbBuilder(asset.header, bytearray(*asset.buffers)).encode())
    file = load(path)
    write(tmp_path / "w.glb", ao.bake(file.mesh, samples=16), file)
    assert len(load(tmp_path / "w.glb").mesh.faces) == 1


@pytest.mark.parametrize("depth", [400, 100_000])
@pytest.mark.parametrize("letters", ["[]", "{}"])
def test_deep_json_is_refused_in_a_line(tmp_path, depth, letters):
    begin, end = ("[", "]") if letters == "[]" else ('{"a":', "}")
    deep = f'{{"asset": {{"version": "2.0"}}, "extras": {begin * depth}1{end * depth}}}'
    assert "content: expected JSON of at most 100 levels, got more" in mistake(tmp_path, "m.gltf", deep.encode())
