"""Output files, read back by readers that are not ours."""

import errno
import json
import os
import time
from types import SimpleNamespace

import numpy as np
import PIL.Image
import pytest
import trimesh
from gltf_files import QUAD, TRIANGLE, Builder, check_glb, values

from raytrace.errors import OptionError, OutputError
from raytrace.image.srgb import encode_srgb
from raytrace.mesh.mesh import Mesh
from scenes.formats.glb.ramp import ramp_png
from scenes.formats.load import MeshFile, load
from scenes.geometry.instances import Submesh
from scenes.write_bake import check_target, write


def mesh_file(vertices=QUAD, faces=((0, 1, 2), (0, 2, 3)), normals=None):
    mesh = Mesh(vertices, faces, normals)
    return MeshFile("m.obj", mesh, (Submesh("m", slice(0, len(mesh.vertices)), slice(0, len(mesh.faces))),))


def bake(count):
    rng = np.random.default_rng(5)
    return SimpleNamespace(
        w=rng.random(count),
        error=rng.random(count) / 100,
        bent_normals=rng.normal(size=(count, 3)),
        flags=rng.integers(0, 8, count),
        profile=None,
    )


def test_npy(tmp_path):
    result = bake(4)
    write(tmp_path / "w.npy", result, mesh_file())
    w = np.load(tmp_path / "w.npy", allow_pickle=False)
    assert w.dtype == np.dtype("<f4")
    np.testing.assert_array_equal(w, result.w.astype(np.float32))


def test_npz(tmp_path):
    result = bake(4)
    write(tmp_path / "w.npz", result, mesh_file())
    with np.load(tmp_path / "w.npz", allow_pickle=False) as stored:
        assert {key: (array.dtype.str, array.shape) for key, array in stored.items()} == {
            "w": ("<f4", (4,)),
            "error": ("<f4", (4,)),
            "bent_normals": ("<f4", (4, 3)),
            "flags": ("|u1", (4,)),
        }
        for key, array in stored.items():
            np.testing.assert_allclose(array, getattr(result, key), rtol=1e-6)


@pytest.mark.parametrize("normals", [None, np.tile([0, 0.6, 0.8], (4, 1))])
@pytest.mark.parametrize("shift", [0.0, 1e6 + 0.1])
def test_ply(tmp_path, normals, shift):
    source = mesh_file(QUAD.astype(np.float64) + shift, normals=normals)
    result = bake(4)
    write(tmp_path / "m.ply", result, source)
    mesh = trimesh.load_mesh(tmp_path / "m.ply", process=False)
    np.testing.assert_array_equal(mesh.vertices, source.mesh.vertices)
    np.testing.assert_array_equal(mesh.faces, source.mesh.faces)
    raw = mesh.metadata["_ply_raw"]["vertex"]
    assert raw["properties"]["obscurance"] == "<f4"
    assert raw["properties"]["x"] == ("<f8" if shift else "<f4")
    assert ("nx" in raw["properties"]) == (normals is not None)
    np.testing.assert_array_equal(raw["data"]["obscurance"], result.w.astype(np.float32))
    grey = mesh.visual.vertex_colors[:, :3] / 255.0
    np.testing.assert_allclose(((grey + 0.055) / 1.055) ** 2.4, np.stack([result.w] * 3, axis=1), atol=0.005)
    again = load(tmp_path / "m.ply").mesh
    np.testing.assert_array_equal(again.vertices, source.mesh.vertices)
    if normals is not None:
        np.testing.assert_allclose(again.normals, normals, atol=1e-7)


def test_half_open_is_half_the_light_to_readers_of_either_format(tmp_path):
    half = SimpleNamespace(w=np.full(4, 0.5), profile=None)
    for ending in ("ply", "glb"):
        write(tmp_path / f"m.{ending}", half, mesh_file(), colors=True)
    colours = trimesh.load_mesh(tmp_path / "m.ply", process=False).visual.vertex_colors
    assert np.unique(colours[:, :3]).tolist() == [188]  # importers of PLY take sRGB
    header, binary = check_glb((tmp_path / "m.glb").read_bytes())
    colours = values(header, binary, header["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])
    assert np.unique(colours[:, :3]).tolist() == [128]  # linear, as glTF has it


@pytest.mark.parametrize("encode", [lambda w: w, encode_srgb])
def test_a_grey_of_either_encoding_is_taken_for_w_and_not_for_a_colour(tmp_path, encode):
    write(tmp_path / "m.ply", bake(4), mesh_file())
    content = bytearray((tmp_path / "m.ply").read_bytes())
    rows = np.frombuffer(
        content, np.dtype([("p", "<f4", 3), ("w", "<f4"), ("grey", "u1", 3)]), 4, content.index(b"end_header\n") + 11
    )
    rows["grey"] = np.rint(255 * encode(rows["w"]))[:, None]
    (tmp_path / "m.ply").write_bytes(content)
    assert load(tmp_path / "m.ply", target="again.ply").detail.colors is None
    rows["grey"] += 1
    (tmp_path / "m.ply").write_bytes(content)
    assert load(tmp_path / "m.ply", target="again.ply").detail.colors is not None


def test_glb_of_a_plain_mesh(tmp_path):
    source = mesh_file(normals=np.tile([0, 0, 2.0], (4, 1)))
    result = bake(4)
    write(tmp_path / "m.glb", result, source)
    header, binary = check_glb((tmp_path / "m.glb").read_bytes())
    (primitive,) = header["meshes"][0]["primitives"]
    assert set(primitive["attributes"]) == {"POSITION", "NORMAL", "TEXCOORD_0", "_OBSCURANCE"}
    accessor = header["accessors"][primitive["attributes"]["_OBSCURANCE"]]
    assert (accessor["componentType"], accessor["type"], accessor["count"]) == (5126, "SCALAR", 4)
    stored = values(header, binary, primitive["attributes"]["_OBSCURANCE"])
    np.testing.assert_array_equal(stored, result.w.astype(np.float32))
    position = header["accessors"][primitive["attributes"]["POSITION"]]
    assert (position["min"], position["max"]) == ([0, 0, 0], [1, 1, 0])
    np.testing.assert_array_equal(values(header, binary, primitive["attributes"]["NORMAL"]), [[0, 0, 1]] * 4)
    assert [node["name"] for node in header["nodes"]] == ["m"]

    scene = trimesh.load_scene(tmp_path / "m.glb", process=False)
    (geometry,) = scene.geometry.values()
    np.testing.assert_array_equal(geometry.vertices, QUAD)
    np.testing.assert_array_equal(geometry.faces, source.mesh.faces)
    np.testing.assert_array_equal(geometry.vertex_attributes["_OBSCURANCE"].ravel(), result.w.astype(np.float32))


def test_glb_far_from_the_origin_loses_nothing_to_float32(tmp_path):
    source = mesh_file(QUAD + np.array([5e6, 1e5 + 0.1, 0]))
    write(tmp_path / "m.glb", bake(4), source)
    np.testing.assert_allclose(load(tmp_path / "m.glb").mesh.vertices, source.mesh.vertices, rtol=0, atol=1e-7)


def test_glb_leaves_out_normals_that_are_none(tmp_path):
    normals = np.array([[0, 0, 1], [0, 0, 0], [0, 0, 1], [np.nan] * 3])
    write(tmp_path / "m.glb", bake(4), mesh_file(normals=normals))
    header, _binary = check_glb((tmp_path / "m.glb").read_bytes())
    assert "NORMAL" not in header["meshes"][0]["primitives"][0]["attributes"]


def textured(tmp_path):
    """Two nodes that share a mesh of two primitives, with a camera, an animation and a texture beside the file."""
    builder = Builder()
    first = builder.primitive(QUAD, [[0, 1, 2], [0, 2, 3]], material=0)
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
    result = bake(len(source.mesh.vertices))
    write(tmp_path / "out.glb", result, source, occlusion="none")
    before, header = source.gltf.header, None
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    for key in ("materials", "textures", "samplers", "cameras", "animations", "extensionsUsed", "scenes", "asset"):
        assert header[key] == before[key]
    assert [{**node, "mesh": 0} for node in header["nodes"]] == [{**node, "mesh": 0} for node in before["nodes"]]
    assert [mesh["name"] for mesh in header["meshes"]] == ["shared", "single", "shared"]
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
    assert again.parts == source.parts
    scene = trimesh.load_scene(tmp_path / "out.glb", process=False)
    attributes = [g.vertex_attributes["_OBSCURANCE"] for g in scene.geometry.values() if hasattr(g, "faces")]
    assert sum(map(len, attributes)) == len(source.mesh.vertices)
    assert before["images"] == [{"uri": "red.png"}]


def test_glb_keeps_a_texture_it_cannot_find_as_a_reference(tmp_path):
    source = textured(tmp_path)
    (tmp_path / "red.png").unlink()
    write(tmp_path / "out.glb", bake(len(source.mesh.vertices)), source, occlusion="none")
    header, _binary = check_glb((tmp_path / "out.glb").read_bytes())
    assert header["images"] == [{"uri": "red.png"}]


def test_glb_from_gltf_with_several_buffers(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, [[0, 1, 2], [0, 2, 3]]))
    (tmp_path / "a.bin").write_bytes(builder.binary[: QUAD.nbytes] + b"odd")
    (tmp_path / "b.bin").write_bytes(builder.binary[QUAD.nbytes :])
    header = builder.header | {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    header["buffers"] = [{"uri": "a.bin", "byteLength": QUAD.nbytes}, {"uri": "b.bin", "byteLength": 12}]
    header["bufferViews"][1] = {"buffer": 1, "byteLength": 12}
    (tmp_path / "m.gltf").write_text(json.dumps(header))
    source = load(tmp_path / "m.gltf")
    write(tmp_path / "out.glb", bake(4), source)
    check_glb((tmp_path / "out.glb").read_bytes())
    np.testing.assert_array_equal(load(tmp_path / "out.glb").mesh.faces, source.mesh.faces)
    np.testing.assert_array_equal(load(tmp_path / "out.glb").mesh.vertices, QUAD)


def test_each_of_several_instances_has_its_own_values(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]))
    (tmp_path / "in.glb").write_bytes(builder.glb([{"mesh": 0}] * 4))
    result = bake(12)
    write(tmp_path / "out.glb", result, load(tmp_path / "in.glb"))
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    attributes = [header["meshes"][node["mesh"]]["primitives"][0]["attributes"] for node in header["nodes"]]
    stored = [values(header, binary, attribute["_OBSCURANCE"]) for attribute in attributes]
    np.testing.assert_array_equal(np.concatenate(stored), result.w.astype(np.float32))
    assert len({attribute["POSITION"] for attribute in attributes}) == 1


@pytest.mark.parametrize("kind", ["plain", "gltf"])
def test_glb_colours_when_asked(tmp_path, kind):
    source = mesh_file() if kind == "plain" else textured(tmp_path)
    result = bake(len(source.mesh.vertices))
    write(tmp_path / "out.glb", result, source, colors=True)
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
    result = bake(len(source.mesh.vertices))
    write(tmp_path / f"a.{ending}", result, source)
    monkeypatch.setattr(time, "time", lambda: 2e9)
    monkeypatch.setattr(time, "localtime", lambda *_: time.gmtime(2e9))
    write(tmp_path / f"b.{ending.upper()}", result, load(tmp_path / "in.glb"))
    assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending.upper()}").read_bytes()


@pytest.mark.parametrize("name", ["w.exr", "w", "npy", "w.npy.gz", ".npy"])
def test_unknown_endings_are_refused_before_any_work(tmp_path, name):
    with pytest.raises(
        OptionError, match=r"output: expected a name ending in \.npy, \.npz, \.ply, \.glb, \.html, got "
    ) as early:
        check_target(tmp_path / name)
    assert str(early.value).endswith(str(tmp_path / name))
    with pytest.raises(OptionError, match="ending in"):
        write(tmp_path / name, bake(4), mesh_file())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ["npy", "npz", "ply", "glb"])
def test_a_full_disk_leaves_an_existing_output(tmp_path, monkeypatch, ending):
    def full(*_arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    target = tmp_path / f"m.{ending}"
    target.write_bytes(b"before")
    check_target(target)
    ramp_png()  # once a process, by way of a file
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match=f"m.{ending}: cannot write: No space left on device"):
        write(target, bake(4), mesh_file())
    assert target.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [target]


def test_a_target_that_is_no_file(tmp_path):
    (tmp_path / "folder.npy").mkdir()
    for name in ("folder.npy", "missing/w.npy"):
        with pytest.raises(OutputError, match="cannot write"):
            check_target(tmp_path / name)
