"""Output files, read back by readers that are not ours."""

import numpy as np
import pytest
import trimesh
from gltf_files import QUAD, check_glb, values
from mesh_files import mesh_file, random_bake

from obscurance.raytrace.errors import OptionError, OutputError
from obscurance.raytrace.image.colour import encode_srgb
from obscurance.scenes.asset.primitive import StoredBake
from obscurance.scenes.formats.gltf.write import ramp_png
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.write import check_target, write


def test_npy(tmp_path):
    result = random_bake(4)
    write(tmp_path / "w.npy", result, mesh_file())
    w = np.load(tmp_path / "w.npy", allow_pickle=False)
    assert w.dtype == np.dtype("<f4")
    np.testing.assert_array_equal(w, result.w.astype(np.float32))


def test_npz(tmp_path):
    result = random_bake(4)
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
    result = random_bake(4)
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
    half = StoredBake(np.full(4, 0.5))
    for ending in ("ply", "glb"):
        write(tmp_path / f"m.{ending}", half, mesh_file(), colors="rgb")
    colours = trimesh.load_mesh(tmp_path / "m.ply", process=False).visual.vertex_colors
    assert np.unique(colours[:, :3]).tolist() == [188]  # importers of PLY take sRGB
    header, binary = check_glb((tmp_path / "m.glb").read_bytes())
    colours = values(header, binary, header["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])
    assert np.unique(colours[:, :3]).tolist() == [128]  # linear, as glTF has it


def test_the_grey_of_a_bake_is_taken_for_w_and_not_for_a_colour(tmp_path):
    write(tmp_path / "m.ply", random_bake(4), mesh_file())
    assert load(tmp_path / "m.ply", target="again.ply").colours(srgb=True) is None
    content = bytearray((tmp_path / "m.ply").read_bytes())
    row = np.dtype([("p", "<f4", 3), ("w", "<f4"), ("grey", "u1", 3), ("e", "<f4"), ("f", "u1"), ("b", "<f4", 3)])
    rows = np.frombuffer(content, row, 4, content.index(b"end_header\n") + 11)
    np.testing.assert_array_equal(rows["grey"], np.rint(255 * encode_srgb(rows["w"]))[:, None].repeat(3, axis=1))
    rows["grey"] += 1
    (tmp_path / "m.ply").write_bytes(content)
    assert load(tmp_path / "m.ply", target="again.ply").colours(srgb=True) is not None


def test_glb_of_a_plain_mesh(tmp_path):
    source = mesh_file(normals=np.tile([0, 0, 2.0], (4, 1)))
    result = random_bake(4)
    write(tmp_path / "m.glb", result, source)
    header, binary = check_glb((tmp_path / "m.glb").read_bytes())
    (primitive,) = header["meshes"][0]["primitives"]
    baked = {f"_OBSCURANCE{name}" for name in ("", "_ERROR", "_FLAGS", "_BENT_NORMALS")}
    assert set(primitive["attributes"]) == {"POSITION", "NORMAL", "TEXCOORD_0", *baked}
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
    write(tmp_path / "m.glb", random_bake(4), source)
    np.testing.assert_allclose(load(tmp_path / "m.glb").mesh.vertices, source.mesh.vertices, rtol=0, atol=1e-7)


def test_glb_has_normals_of_faces_in_place_of_those_that_are_none(tmp_path):
    normals = np.array([[0, 0, 1], [0, 0, 0], [0, 0, 1], [np.nan] * 3])
    write(tmp_path / "m.glb", random_bake(4), mesh_file(normals=normals))
    header, binary = check_glb((tmp_path / "m.glb").read_bytes())
    found = values(header, binary, header["meshes"][0]["primitives"][0]["attributes"]["NORMAL"])
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-6)


@pytest.mark.parametrize("name", ["w.exr", "w", "npy", "w.npy.gz", ".npy"])
def test_unknown_endings_are_refused_before_any_work(tmp_path, name):
    with pytest.raises(
        OptionError, match=r"output: expected a name ending in \.glb, \.html, \.npy, \.npz, \.obj, \.ply, \.vtp, got "
    ) as early:
        check_target(tmp_path / name)
    assert str(early.value).endswith(str(tmp_path / name))
    with pytest.raises(OptionError, match="ending in"):
        write(tmp_path / name, random_bake(4), mesh_file())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ["npy", "npz", "ply", "glb"])
def test_a_full_disk_leaves_an_existing_output(tmp_path, fail_call, ending):
    target = tmp_path / f"m.{ending}"
    target.write_bytes(b"before")
    check_target(target)
    ramp_png()  # once a process, by way of a file
    fail_call("fsync")
    with pytest.raises(OutputError, match=f"m.{ending}: cannot write: No space left on device"):
        write(target, random_bake(4), mesh_file())
    assert target.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [target]
