"""Mesh files of several objects: hierarchies, instances, references to other files."""

import base64
import json

import numpy as np
import pytest
from fuzz_seeds import MODEL, archive
from gltf_files import QUAD, TRIANGLE, Builder
from mesh_files import read

from obscurance.raytrace.errors import MeshError
from obscurance.scenes.formats.load import load


def test_hierarchy_repeated_and_mirrored_nodes(tmp_path):
    builder = Builder()
    normals = np.tile([0.0, 0.0, 1.0], (3, 1))
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]], normals), name="leaf")
    half_turn = [0, 0, 1, 0]
    nodes = [
        {"name": "root", "translation": [10, 0, 0], "children": [1, 2], "camera": 0},
        {"name": "first", "mesh": 0, "scale": [-1, 1, 1]},
        {"name": "group", "rotation": half_turn, "children": [3]},
        {"mesh": 0, "translation": [0, 0, 5], "scale": [1, 1, 2]},
    ]
    camera = {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "aspectRatio": 1}}
    file = read(tmp_path, "m.glb", builder.glb(nodes, [0], cameras=[camera]))
    assert [part.name for part in file.parts] == ["first", "leaf"]
    assert [part.vertices for part in file.parts] == [slice(0, 3), slice(3, 6)]
    mirrored, turned = (file.mesh.vertices[part.vertices] for part in file.parts)
    np.testing.assert_allclose(mirrored, [[10, 0, 0], [9, 0, 0], [10, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(turned, [[10, 0, 5], [9, 0, 5], [10, -1, 5]], atol=1e-12)
    assert file.mesh.faces.tolist() == [[2, 1, 0], [3, 4, 5]]
    a, b, c = (file.mesh.vertices[file.mesh.faces[:, corner]] for corner in range(3))
    face_normals = np.cross(b - a, c - a)
    assert (np.einsum("ij,ij->i", face_normals, file.mesh.normals[file.mesh.faces[:, 0]]) > 0).all()


def test_deep_hierarchies_are_no_burden(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]))
    nodes = [{"mesh": 0, "translation": [1, 0, 0], "children": [number + 1]} for number in range(3000)]
    file = read(tmp_path, "m.glb", builder.glb([*nodes, {"mesh": 0}], [0]))
    assert [file.mesh.vertices[part.vertices][0, 0] for part in file.parts] == [*range(1, 3001), 3000]


def test_normals_go_by_the_inverse_transpose(tmp_path):
    builder = Builder()
    slope = np.array([[0, 0, 0], [1, 0, 1], [0, 1, 0]], dtype="<f4")
    builder.mesh(builder.primitive(slope, [[0, 1, 2]], np.tile([-1.0, 0, 1], (3, 1))))
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]))
    file = read(tmp_path, "m.glb", builder.glb([{"mesh": 0, "scale": [4, 1, -1]}, {"mesh": 1}, {"mesh": 0}]))
    a, b, c = file.mesh.vertices[file.mesh.faces[0]]
    expected = np.cross(b - a, c - a)
    got = file.mesh.normals[0]
    np.testing.assert_allclose(got / np.linalg.norm(got), expected / np.linalg.norm(expected), atol=1e-12)
    assert np.isnan(file.mesh.normals[3:6]).all()


def test_a_node_that_flattens_its_mesh_is_kept(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]], np.tile([0.0, 0, 1], (3, 1))))
    file = read(tmp_path, "m.glb", builder.glb([{"mesh": 0, "scale": [1, 1, 0]}]))
    np.testing.assert_array_equal(file.mesh.normals, [[0, 0, 1]] * 3)


def test_points_and_lines_beside_a_mesh_are_left_out(tmp_path):
    builder = Builder()
    points = builder.primitive(QUAD, mode=0)
    lines = builder.primitive(QUAD, mode=1)
    loop = builder.primitive(QUAD, mode=2)
    builder.mesh(points, lines, builder.primitive(TRIANGLE, [[0, 1, 2]]), loop)
    file = read(tmp_path, "m.glb", builder.glb([{"mesh": 0, "name": "mixed"}]))
    assert len(file.mesh.vertices) == 3
    assert [part.name for part in file.parts] == ["mixed[2]"]


def test_strips_fans_unindexed_triangles_and_stored_integers(tmp_path):
    builder = Builder()
    unsigned = np.array([[0, 0, 0, 0], [65535, 0, 0, 0], [0, 65535, 0, 0]], dtype="<u2")
    packed = builder.accessor(unsigned, "VEC3", normalized=True)
    builder.header["bufferViews"][-1]["byteStride"] = 8
    builder.mesh(
        builder.primitive(QUAD[[0, 1, 3, 2]], mode=5), builder.primitive(TRIANGLE),
        {"attributes": {"POSITION": packed}},
        builder.primitive(QUAD, [[3, 0, 1, 2]], mode=6),
    )  # fmt: skip
    file = read(tmp_path, "m.glb", builder.glb([{"mesh": 0}]))
    a, b, c = (file.mesh.vertices[file.mesh.faces[:, corner]] for corner in range(3))
    np.testing.assert_allclose(np.cross(b - a, c - a), [[0, 0, 1]] * 6)
    np.testing.assert_allclose(file.mesh.vertices[7:10], TRIANGLE)
    assert file.mesh.faces[4:].tolist() == [[13, 10, 11], [13, 11, 12]]


def test_only_the_default_scene_is_read(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]))
    nodes = [{"mesh": 0, "name": "other"}, {"mesh": 0, "name": "shown"}]
    data = builder.glb(nodes, scenes=[{"nodes": [0]}, {"nodes": [1]}], scene=1)
    assert [part.name for part in read(tmp_path, "m.glb", data).parts] == ["shown"]


def test_names_used_twice_and_names_of_our_own(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]), name="world")
    nodes = [{"mesh": 0, "name": "world", "children": [1]}, {"mesh": 0, "name": "world", "translation": [0, 0, 1]}]
    file = read(tmp_path, "m.glb", builder.glb(nodes, [0]))
    assert file.mesh.vertices[:, 2].tolist() == [0, 0, 0, 1, 1, 1]


def external(tmp_path, uri):
    """A .gltf in a folder of its own, with its buffer at `uri`."""
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 2]]))
    folder = tmp_path / "folder"
    folder.mkdir()
    header = builder.gltf([{"mesh": 0}], uri=uri, textures=[{"source": 0}], images=[{"uri": "missing.png"}])
    header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    (folder / "m.gltf").write_text(json.dumps(header))
    return folder / "m.gltf", builder.binary


@pytest.mark.parametrize("uri", ["data.bin", "./data.bin", "sub/data.bin", "with%20space.bin"])
def test_gltf_with_an_external_buffer(tmp_path, uri):
    path, binary = external(tmp_path, uri)
    (path.parent / "sub").mkdir()
    (path.parent / uri.replace("%20", " ")).write_bytes(binary)
    np.testing.assert_array_equal(load(path).mesh.vertices, TRIANGLE)


def test_gltf_with_an_embedded_buffer(tmp_path):
    path, binary = external(tmp_path, "x")
    embedded = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    path.write_text(path.read_text().replace('"uri": "x"', f'"uri": "{embedded}"'))
    np.testing.assert_array_equal(load(path).mesh.vertices, TRIANGLE)


@pytest.mark.parametrize("uri", ["missing.bin", "../secret.bin", "%2e%2e/secret.bin", "{root}/secret.bin", "link.bin",
                                 "file://{root}/secret.bin", "https://example.com/data.bin", "", "\0"])  # fmt: skip
def test_gltf_buffers_outside_the_folder_are_refused(tmp_path, uri):
    path, binary = external(tmp_path, uri.format(root=tmp_path))
    (tmp_path / "secret.bin").write_bytes(binary)
    (path.parent / "link.bin").symlink_to(tmp_path / "secret.bin")
    with pytest.raises(MeshError, match=r"m\.gltf: buffers\[0\]: expected data in or beside the file"):
        load(path)


def test_3mf_repeats_and_places_its_objects(tmp_path):
    file = read(tmp_path, "m.3mf", archive(**{"3D/3dmodel.model": MODEL}))
    lowest = [file.mesh.vertices[part.vertices].min(axis=0).tolist() for part in file.parts]
    assert [part.name for part in file.parts] == ["one"] * 3
    assert sorted(lowest) == [[0, 0, 0], [0, 0, 2], [5, 0, 2]]
    assert len(file.mesh.vertices) == 12


def test_copies_by_an_extension_are_reported(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE))
    nodes = [{"name": "tree", "mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {}}}}]
    (tmp_path / "forest.glb").write_bytes(builder.glb(nodes))
    (note,) = load(tmp_path / "forest.glb").notes
    assert note.endswith(
        "forest.glb: tree is drawn many times by EXT_mesh_gpu_instancing, which is not read: once here"
    )
