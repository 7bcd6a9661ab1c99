"""Geometry that Draco has compressed: read as the plain file is, written plain."""

import sys

import DracoPy
import numpy as np
import pytest
from command import obscurance, refused, succeeded
from gltf_files import Builder, check_glb, values
from gltf_samples import picture, with_images
from meshes import hills

from obscurance.scenes.formats.load import load

NAME = "KHR_draco_mesh_compression"
PAINTED = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}


def rich():
    """Vertices, faces, normals and texture coordinates; all on a grid that 16 bits hold exactly, but for normals."""
    vertices, faces = hills(9)
    vertices = np.round(np.asarray(vertices) * 64) / 64
    normals = np.tile([0, 0, 1.0], (len(vertices), 1))
    uv = (vertices[:, :2] - vertices[:, :2].min(axis=0)) / 8
    return vertices.astype("<f4"), np.asarray(faces), normals.astype("<f4"), uv.astype("<f4")


def glb(compressed, change=lambda builder: None):
    """The same mesh, twice, plain or compressed."""
    vertices, faces, normals, uv = rich()
    builder = Builder()
    primitive = builder.primitive(vertices, faces, normals, material=0)
    primitive["attributes"]["TEXCOORD_0"] = builder.accessor(uv, "VEC2")
    fields = {"materials": [PAINTED], **with_images(builder, picture())}
    if compressed:
        data = DracoPy.encode(
            vertices, faces.astype("<u4"), 20, normals=normals.astype(float), tex_coord=uv.astype(float)
        )
        kinds = {int(column["attribute_type"]): column["unique_id"] for column in DracoPy.decode(data).attributes}
        numbers = {"POSITION": kinds[0], "NORMAL": kinds[1], "TEXCOORD_0": kinds[3]}
        decoded = DracoPy.decode(data)
        for number in (*primitive["attributes"].values(), primitive["indices"]):
            accessor = builder.header["accessors"][number]
            del accessor["bufferView"]
            accessor["count"] = decoded.faces.size if number == primitive["indices"] else len(decoded.points)
        view = {"buffer": 0, "byteOffset": len(builder.binary), "byteLength": len(data)}
        builder.binary += data + b"\0" * (-len(data) % 4)
        builder.header["bufferViews"].append(view)
        primitive["extensions"] = {NAME: {"bufferView": len(builder.header["bufferViews"]) - 1, "attributes": numbers}}
        fields |= {"extensionsUsed": [NAME], "extensionsRequired": [NAME]}
    builder.mesh(primitive)
    change(builder)
    return builder.glb([{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 9]}], **fields)


def corners(file):
    """Rows of position, normal and coordinates of the corners of each face, faces in an order of their own."""
    mesh = file.mesh
    rows = np.concatenate([mesh.vertices[mesh.faces], mesh.normals[mesh.faces], file.uv], axis=2).round(3) + 0.0
    turned = [np.roll(face, -min(range(3), key=lambda k: tuple(face[k])), axis=0) for face in rows]
    return np.array(sorted(turned, key=lambda face: face.ravel().tolist()))


@pytest.fixture
def files(tmp_path):
    for name, compressed in (("plain.glb", False), ("draco.glb", True)):
        (tmp_path / name).write_bytes(glb(compressed))
    return tmp_path


def test_a_compressed_file_is_read_as_the_plain_one(files):
    plain, packed = (load(files / name) for name in ("plain.glb", "draco.glb"))
    assert len(packed.parts) == len(plain.parts) == 2
    np.testing.assert_allclose(corners(packed), corners(plain), atol=2e-3)


def test_commands_take_it_and_write_plain_values(files):
    for line in (
        ("bake", "draco.glb", "-o", "w.glb"),
        ("bake", "draco.glb", "-o", "t.glb", "--occlusion", "texture", "--size", 32),
        ("bake", "draco.glb", "-o", "w.ply"),
        ("render", "draco.glb", "-o", "p.png", "--width", 16, "--height", 16),
    ):
        names = [files / word if "." in str(word) else word for word in line]
        succeeded(*names, "--samples", 4)
    for name in ("w.glb", "t.glb"):
        header, binary = check_glb((files / name).read_bytes())
        assert NAME not in str(header)
        for number in header["meshes"][0]["primitives"][0]["attributes"].values():
            rows = values(header, binary, number)
            assert np.isfinite(rows).all()
            for bound in {"min", "max"} & header["accessors"][number].keys():
                assert header["accessors"][number][bound] == getattr(rows, bound)(axis=0).tolist()
    np.testing.assert_allclose(corners(load(files / "w.glb")), corners(load(files / "plain.glb")), atol=2e-3)


def test_without_the_library_a_line_says_what_to_install(files, monkeypatch):
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    refused(obscurance("info", files / "draco.glb"), "draco.glb: format: expected DracoPy", "pip install DracoPy")
    succeeded("info", files / "plain.glb")


def other_count(builder):
    builder.header["accessors"][0]["count"] += 1


def damaged(builder):
    at = builder.header["bufferViews"][-1]["byteOffset"] + 40
    builder.binary = builder.binary[:at] + bytes(len(builder.binary) - at)


def without_indices(builder):
    del builder.header["meshes"][0]["primitives"][0]["indices"]


def no_such_attribute(builder):
    builder.header["meshes"][0]["primitives"][0]["extensions"][NAME]["attributes"]["POSITION"] = 77


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (other_count, "VEC3, compressed, got shape"),
        (damaged, "draco.glb: content: expected a complete and valid GLB file"),
        (without_indices, "indices: expected an accessor of a compressed primitive's, got none"),
        (no_such_attribute, "draco.glb: content: expected a complete and valid GLB file"),
    ],
)
def test_malformed_ones_end_in_one_line(tmp_path, change, words):
    (tmp_path / "draco.glb").write_bytes(glb(True, change))
    refused(obscurance("info", tmp_path / "draco.glb"), words)
