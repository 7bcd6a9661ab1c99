""".glb outputs of glTF sources: everything of the source is kept."""

import json
import time

import numpy as np
import PIL.Image
import pytest
import trimesh
from gltf_files import HALVES, QUAD, TRIANGLE, Builder, check_glb, values
from mesh_files import mesh_file, random_bake

from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.write import write


def textured(tmp_path):
    """Two nodes that share a mesh of two primitives, with a camera, an animation and a texture beside the file."""
    builder = Builder()
    first = builder.primitive(QUAD, HALVES, material=0)
    first["attributes"]["TEXCOORD_0"] = builder.accessor(QUAD[:, :2].copy(), "VEC2")
    builder.mesh(first, builder.primitive(QUAD, mode=1), builder.primitive(TRIANGLE, [[0, 1, 2]]), name="shared")
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]), name="single")
    times = builder.accessor(np.array([0, 1], dtype="<f4"), "SCALAR")
    moves = builder.accessor(np.zeros((2, 3), dtype="<f4"), "VEC3")
    nodes = [
        {"name": "root", "children": [1, 2], "scale": [2, 2, 2]},
        {"name": "left", "mesh": 0, "extras": {"kept": True}},
        {"name": "right", "mesh": 0, "translation": [3, 0, 0]},
        {"name": "alone", "mesh": 1, "camera": 0},
    ]
    PIL.Image.new("RGB", (2, 2), (200, 10, 10)).save(tmp_path / "red.png")
    data = builder.glb(
        nodes,
        [0, 3],
        materials=[{"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "doubleSided": True}],
        textures=[{"source": 0, "sampler": 0}],
        samplers=[{"wrapS": 33071}],
        images=[{"uri": "red.png"}],
        cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
        animations=[
            {
                "samplers": [{"input": times, "output": moves}],
                "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}],
            }
        ],
        extensionsUsed=["KHR_materials_unlit"],
    )
    (tmp_path / "in.glb").write_bytes(data)
    return load(tmp_path / "in.glb")


def test_glb_keeps_everything_of_a_gltf_source(tmp_path):
    source = textured(tmp_path)
    result = random_bake(len(source.mesh.vertices))
    write(tmp_path / "out.glb", result, source, occlusion="none")
    before, header = source.raw.header, None
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    for key in ("materials", "textures", "samplers", "cameras", "animations", "extensionsUsed", "scenes", "asset"):
        assert header[key] == before[key]
    assert [{**node, "mesh": 0} for node in header["nodes"]] == [{**node, "mesh": 0} for node in before["nodes"]]
    assert [mesh["name"] for mesh in header["meshes"]] == ["shared", "single", "shared"]
    assert len({mesh["primitives"][0]["attributes"]["POSITION"] for mesh in header["meshes"][::2]}) == 1
    (image,) = header["images"]
    assert set(image) == {"bufferView", "mimeType"}
    view = header["bufferViews"][image["bufferView"]]
    picture = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    assert picture == (tmp_path / "red.png").read_bytes()

    parts = iter(source.parts)
    for node in (1, 2, 3):
        for primitive in header["meshes"][header["nodes"][node]["mesh"]]["primitives"]:
            if primitive.get("mode") == 1:
                assert "_OBSCURANCE" not in primitive["attributes"]
                continue
            stored = values(header, binary, primitive["attributes"]["_OBSCURANCE"])
            np.testing.assert_array_equal(stored, result.w[next(parts).vertices].astype(np.float32))
            assert "COLOR_0" not in primitive["attributes"]
    assert next(parts, None) is None

    again = load(tmp_path / "out.glb")
    np.testing.assert_array_equal(again.mesh.vertices, source.mesh.vertices)
    np.testing.assert_array_equal(again.mesh.faces, source.mesh.faces)
    assert [part[:3] for part in again.parts] == [part[:3] for part in source.parts]
    scene = trimesh.load_scene(tmp_path / "out.glb", process=False)
    attributes = [g.vertex_attributes["_OBSCURANCE"] for g in scene.geometry.values() if hasattr(g, "faces")]
    assert sum(map(len, attributes)) == len(source.mesh.vertices)
    assert before["images"] == [{"uri": "red.png"}]


def test_glb_keeps_a_texture_it_cannot_find_as_a_reference(tmp_path):
    source = textured(tmp_path)
    (tmp_path / "red.png").unlink()
    write(tmp_path / "out.glb", random_bake(len(source.mesh.vertices)), source, occlusion="none")
    header, _binary = check_glb((tmp_path / "out.glb").read_bytes())
    assert header["images"] == [{"uri": "red.png"}]


def test_glb_from_gltf_with_several_buffers(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, HALVES))
    (tmp_path / "a.bin").write_bytes(builder.binary[: QUAD.nbytes] + b"odd")
    (tmp_path / "b.bin").write_bytes(builder.binary[QUAD.nbytes :])
    header = builder.gltf([{"mesh": 0}])
    header["buffers"] = [{"uri": "a.bin", "byteLength": QUAD.nbytes}, {"uri": "b.bin", "byteLength": 12}]
    header["bufferViews"][1] = {"buffer": 1, "byteLength": 12}
    (tmp_path / "m.gltf").write_text(json.dumps(header))
    source = load(tmp_path / "m.gltf")
    write(tmp_path / "out.glb", random_bake(4), source)
    check_glb((tmp_path / "out.glb").read_bytes())
    np.testing.assert_array_equal(load(tmp_path / "out.glb").mesh.faces, source.mesh.faces)
    np.testing.assert_array_equal(load(tmp_path / "out.glb").mesh.vertices, QUAD)


@pytest.mark.parametrize("kind", ["plain", "gltf"])
def test_glb_colours_when_asked(tmp_path, kind):
    source = mesh_file() if kind == "plain" else textured(tmp_path)
    result = random_bake(len(source.mesh.vertices))
    write(tmp_path / "out.glb", result, source, colors="rgb")
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    primitive = header["meshes"][0]["primitives"][0]
    accessor = header["accessors"][primitive["attributes"]["COLOR_0"]]
    assert (accessor["componentType"], accessor["type"], accessor["normalized"]) == (5121, "VEC4", True)
    grey = np.rint(result.w[source.parts[0].vertices] * 255)
    colors = values(header, binary, primitive["attributes"]["COLOR_0"])
    np.testing.assert_array_equal(colors, np.stack([grey, grey, grey, np.full_like(grey, 255)], axis=1))


@pytest.mark.parametrize("ending", ["npy", "npz", "ply", "glb"])
def test_the_same_input_gives_the_same_bytes_at_any_time(tmp_path, monkeypatch, ending):
    source = textured(tmp_path)
    result = random_bake(len(source.mesh.vertices))
    write(tmp_path / f"a.{ending}", result, source)
    monkeypatch.setattr(time, "time", lambda: 2e9)
    write(tmp_path / f"b.{ending.upper()}", result, load(tmp_path / "in.glb"))
    assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending.upper()}").read_bytes()
