"""Mesh files: every vertex as stored, every careless mistake one line."""

import base64
import json
import os
import struct
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest
import trimesh
from gltf_files import QUAD, TRIANGLE, Builder

from raytrace.errors import MeshError
from scenes.load import load

# Two squares that share an edge; vertex 2 repeats vertex 1, vertex 6 is unused.
VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.25], [2, 0, 0], [9, 9, 9]])
FACES = np.array([[0, 1, 3], [0, 3, 4], [2, 5, 3]])
NORMALS = np.tile([0.0, 0.6, 0.8], (len(VERTICES), 1))


def ply(vertices=VERTICES, faces=FACES, order="<", normals=None, texture=False):
    """A binary PLY file."""
    names = ["x", "y", "z"] + (["nx", "ny", "nz"] if normals is not None else []) + (["s", "t"] if texture else [])
    rows = np.zeros((len(vertices), len(names)), dtype=f"{order}f4")
    rows[:, :3] = vertices
    if normals is not None:
        rows[:, 3:6] = normals
    if texture:
        rows[:, -2:] = np.arange(2 * len(vertices)).reshape(-1, 2)
    packed = np.zeros(len(faces), dtype=[("n", "u1"), ("i", f"{order}i4", np.shape(faces)[1])])
    packed["n"], packed["i"] = np.shape(faces)[1], faces
    header = ["ply", f"format binary_{'little' if order == '<' else 'big'}_endian 1.0"]
    header += [f"element vertex {len(vertices)}", *(f"property float {name}" for name in names)]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header\n"]
    return "\n".join(header).encode() + rows.tobytes() + packed.tobytes()


def ascii_ply(vertices=VERTICES, faces=FACES):
    header = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    header += [f"property double {name}" for name in "xyz"]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(map(str, vertex)) for vertex in vertices]
    rows += [" ".join(map(str, [len(face), *face])) for face in faces]
    return "\n".join([*header, *rows, ""]).encode()


def off(vertices=VERTICES, faces=FACES):
    rows = [" ".join(map(str, vertex)) for vertex in vertices]
    rows += [" ".join(map(str, [len(face), *face])) for face in faces]
    return "\n".join(["OFF", "# made for a test", f"{len(vertices)} {len(faces)} 0", *rows, ""]).encode()


def obj(vertices=VERTICES, faces=FACES):
    rows = ["v {} {} {}".format(*vertex) for vertex in vertices]
    rows += ["f " + " ".join(str(index + 1) for index in face) for face in faces]
    return "\n".join([*rows, ""]).encode()


def stl(triangles):
    packed = np.zeros(len(triangles), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    packed["v"] = triangles
    return bytes(80) + len(triangles).to_bytes(4, "little") + packed.tobytes()


def ascii_stl(*solids):
    lines = []
    for name, triangles in solids:
        lines.append(f"solid {name}")
        for triangle in triangles:
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += ["vertex {} {} {}".format(*corner) for corner in triangle]
            lines += ["endloop", "endfacet"]
        lines.append(f"endsolid {name}")
    return "\n".join([*lines, ""]).encode()


def glb():
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, [[0, 1, 2], [0, 2, 3]]))
    return builder.glb([{"mesh": 0, "name": "quad"}])


def read(tmp_path, name, data):
    path = tmp_path / name
    path.write_bytes(data)
    return load(path)


def mistake(tmp_path, name, data):
    """The message of the error that loading `data` must give."""
    with pytest.raises(MeshError) as error:
        read(tmp_path, name, data)
    message = str(error.value)
    assert "\n" not in message
    assert str(tmp_path / name) in message
    return message


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("m.ply", ply()),
        ("m.PLY", ply(order=">")),
        ("texture.ply", ply(texture=True)),
        ("ascii.ply", ascii_ply()),
        ("m.off", off()),
        ("latin.off", off().replace(b"made for", b"f\xfcr")),
        ("m.obj", obj()),
    ],
)
def test_indexed_formats_give_the_stored_vertices(tmp_path, name, data):
    file = read(tmp_path, name, data)
    assert np.array_equal(file.mesh.vertices, VERTICES)
    assert np.array_equal(file.mesh.faces, FACES)
    assert file.mesh.vertices.dtype == np.float64
    assert file.mesh.normals is None
    (part,) = file.parts
    assert (part.name, part.vertices, part.faces) == (name.split(".")[0], slice(0, 7), slice(0, 3))
    assert file.mesh.source == str(file.path) == str(tmp_path / name)


@pytest.mark.parametrize("format", ["binary", "ascii", "latin", "two solids"])
def test_stl_gives_three_vertices_a_face(tmp_path, format):
    triangles = VERTICES[FACES]
    data = {
        "binary": stl(triangles),
        "ascii": ascii_stl(("one", triangles)),
        "latin": ascii_stl(("one", triangles)).replace(b"one", b"\xfcber"),
        "two solids": ascii_stl(("one", triangles[:1]), ("two", triangles[1:])),
    }[format]
    file = read(tmp_path, "m.stl", data)
    assert np.array_equal(file.mesh.vertices, triangles.reshape(-1, 3))
    assert np.array_equal(file.mesh.faces, np.arange(9).reshape(-1, 3))
    if format == "two solids":
        assert [part.name for part in file.parts] == ["one", "two"]
        assert file.parts[1].vertices == slice(3, 9)


@pytest.mark.parametrize("write", [ply, ascii_ply, off, obj])
def test_quads_become_two_triangles(tmp_path, write):
    file = read(tmp_path, f"m.{write.__name__.split('_')[-1]}", write(VERTICES, [[0, 1, 3, 4]]))
    assert np.array_equal(file.mesh.vertices, VERTICES)
    assert {frozenset(face) for face in file.mesh.faces.tolist()} == {frozenset({0, 1, 3}), frozenset({0, 3, 4})}


def test_mixed_polygons_become_fans_in_order(tmp_path):
    assert read(tmp_path, "m.obj", obj(VERTICES, MIXED)).mesh.faces.tolist() == MIXED_FANS


def test_ply_normals(tmp_path):
    file = read(tmp_path, "m.ply", ply(normals=NORMALS))
    np.testing.assert_allclose(file.mesh.normals, NORMALS, atol=1e-7)


def mixed_ply(order="<"):
    """Triangles, a quadrilateral and a pentagon, with a list and a number of no interest in each row."""
    header = ["ply", f"format binary_{'little' if order == '<' else 'big'}_endian 1.0"]
    header += [f"element vertex {len(VERTICES)}", *(f"property double {name}" for name in ("x", "y", "z"))]
    header += [*(f"property float {name}" for name in ("nx", "ny", "nz")), "element face 3", "property uchar flags"]
    header += ["property list uchar int vertex_indices", "property list uchar float texcoord", "end_header\n"]
    rows = np.zeros(len(VERTICES), dtype=[("v", f"{order}f8", 3), ("n", f"{order}f4", 3)])
    rows["v"], rows["n"] = VERTICES, NORMALS
    data = "\n".join(header).encode() + rows.tobytes()
    for polygon in MIXED:
        data += struct.pack(f"{order}BB{len(polygon)}iB2f", 7, len(polygon), *polygon, 2, 0.5, 0.5)
    return data


MIXED = [[0, 1, 3], [0, 1, 5, 3, 4], [2, 5, 3, 0]]
MIXED_FANS = [[0, 1, 3], [0, 1, 5], [0, 5, 3], [0, 3, 4], [2, 5, 3], [2, 3, 0]]


@pytest.mark.parametrize("order", "<>")
def test_binary_ply_with_mixed_polygons(tmp_path, order):
    file = read(tmp_path, "m.ply", mixed_ply(order))
    assert np.array_equal(file.mesh.vertices, VERTICES)
    assert file.mesh.faces.tolist() == MIXED_FANS
    np.testing.assert_allclose(file.mesh.normals, NORMALS, atol=1e-7)


def test_mixed_polygons_as_long_as_even_ones(tmp_path):
    data = mixed_ply()
    data = data[: data.rindex(b"end_header\n") + 11 + len(VERTICES) * 36]
    for polygon in ([0, 1, 5, 3], [0, 1, 3], [0, 1, 5, 3, 4]):
        data += struct.pack(f"<BB{len(polygon)}iB2f", 7, len(polygon), *polygon, 2, 0.5, 0.5)
    faces = [[0, 1, 5], [0, 5, 3], [0, 1, 3], [0, 1, 5], [0, 5, 3], [0, 3, 4]]
    assert read(tmp_path, "m.ply", data).mesh.faces.tolist() == faces


# --- OBJ ---------------------------------------------------------------------------------------------------------


def obj_with(faces, extra="", vertices=VERTICES):
    rows = ["v {} {} {}".format(*vertex) for vertex in vertices]
    return ("\n".join(rows) + f"\n{extra}\n{faces}\n").encode()


@pytest.mark.parametrize(
    "faces",
    [
        "f 1/1 2/2 4/3\nf 1/2 4/1 5/3\nf 3/1 6/1 4/2",
        "f 1/1/1 2/2/1 4/3/1\nf 1/2/1 4/1/1 5/3/1\nf 3/1/1 6/1/1 4/2/1",
        "f 1//1 2//1 4//1\nf 1//1 4//1 5//1\nf 3//1 6//1 4//1",
        "f 1//1 2//1 4//1\nf 1 4 5\nf 3//1 6//1 4//1",
        "usemtl a\nf 1 2 4\nusemtl b\nf 1 4 5\nusemtl a\nf 3 6 4",
        "o a\nf 1 2 4\no b\ng g\ns 1\nf 1 4 5\no a\nf 3 6 4",
        "f -7 -6 -4\nf -7 -4 -3\nf -5 -2 -4",
        "  f\t1 2 4 # one\r\nf 1 4 \\\n5\nf 3 6 4",
    ],
)
def test_obj_vertices_are_the_v_lines(tmp_path, faces):
    file = read(tmp_path, "m.obj", obj_with(faces, "mtllib missing.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1"))
    assert np.array_equal(file.mesh.vertices, VERTICES)
    assert np.array_equal(file.mesh.faces, FACES)
    assert len(file.parts) == 1


def test_obj_relative_indices_count_from_their_own_line(tmp_path):
    text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf -3//-1 -2//-1 -1//-1\nv 5 5 5\nvn 1 0 0\nf -1//-1 -3//-2 -2//-2\n"
    file = read(tmp_path, "m.obj", text)
    assert file.mesh.faces.tolist() == [[0, 1, 2], [3, 1, 2]]
    np.testing.assert_array_equal(file.mesh.normals, [[0, 0, 1]] * 3 + [[1, 0, 0]])


def test_obj_colours_beside_vertices_do_not_matter(tmp_path):
    file = read(tmp_path, "m.obj", b"v 0 0 0 nan nan nan\nv 1 0 0 .5 .5 .5\nv 0 1 0\nf 1 2 3\n")
    assert file.mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_obj_normals_where_each_vertex_has_one(tmp_path):
    normals = "vn 0 0 1\nvn 0 1 0\nvn 0 0 1"
    file = read(tmp_path, "m.obj", obj_with("f 1//1 2//2 4//3\nf 1//3 4//1 5//1", normals))
    np.testing.assert_array_equal(file.mesh.normals[[0, 1, 3, 4]], [[0, 0, 1], [0, 1, 0], [0, 0, 1], [0, 0, 1]])
    assert np.isnan(file.mesh.normals[[2, 5, 6]]).all()


@pytest.mark.parametrize("faces", ["f 1//1 2//1 4//1\nf 1//2 4//1 5//1", "f 1//1 2//1 4//1\nf 1 4 5", "f 1/1 2/1 4/1"])
def test_obj_normals_are_none_where_vertices_have_several_or_corners_none(tmp_path, faces):
    assert read(tmp_path, "m.obj", obj_with(faces, "vn 0 0 1\nvn 0 1 0\nvt 0 0")).mesh.normals is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("f 1 2 99", "v indices from 1 to 7, got 99"),
        ("f 0 1 2", "got 0"),
        ("f -8 -2 -1", "got 0"),
        ("f -1 -2 -99", "got -91"),
        ("f 1//1 2//1 3//5", "vn indices from 1 to 1, got 5"),
        ("f 1 2", "three corners or more, got 2"),
        ("f 1 2 4\nf", "m.obj"),
        ("f a b c", "unmatched data"),
        ("v 1 2\nf 1 2 3", "three coordinates"),
        ("v 1 2 oops\nf 1 2 3", "unmatched data"),
        ("v nan 0 0\nf 1 2 3", "finite coordinates"),
        ("f 1 2 99999999999999999999999", "indices from 1 to 7"),
        ("l 1 2", "at least one triangle, got none, and 7 points"),
    ],
)
def test_obj_mistakes(tmp_path, text, expected):
    if text == "f 1 2 4\nf":
        assert len(read(tmp_path, "m.obj", obj_with(text)).mesh.faces) == 1
    else:
        assert expected in mistake(tmp_path, "m.obj", obj_with(text, "vn 0 0 1"))


# --- Scenes ------------------------------------------------------------------------------------------------------


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


def test_strips_unindexed_triangles_and_stored_integers(tmp_path):
    builder = Builder()
    unsigned = np.array([[0, 0, 0, 0], [65535, 0, 0, 0], [0, 65535, 0, 0]], dtype="<u2")
    packed = builder.accessor(unsigned, "VEC3", normalized=True)
    builder.header["bufferViews"][-1]["byteStride"] = 8
    builder.mesh(
        builder.primitive(QUAD[[0, 1, 3, 2]], mode=5),
        builder.primitive(TRIANGLE),
        {"attributes": {"POSITION": packed}},
    )
    file = read(tmp_path, "m.glb", builder.glb([{"mesh": 0}]))
    a, b, c = (file.mesh.vertices[file.mesh.faces[:, corner]] for corner in range(3))
    np.testing.assert_allclose(np.cross(b - a, c - a), [[0, 0, 1]] * 4)
    np.testing.assert_allclose(file.mesh.vertices[7:], TRIANGLE)


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
    builder.header |= {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    builder.header["buffers"] = [{"uri": uri, "byteLength": len(builder.binary)}]
    builder.header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    builder.header |= {"textures": [{"source": 0}], "images": [{"uri": "missing.png"}]}
    (folder / "m.gltf").write_text(json.dumps(builder.header))
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
    scene = trimesh.Scene()
    box = trimesh.creation.box()
    scene.add_geometry(box, geom_name="box", node_name="near")
    scene.add_geometry(
        box, geom_name="box", node_name="far", transform=trimesh.transformations.translation_matrix([5, 0, 0])
    )
    file = read(tmp_path, "m.3mf", scene.export(file_type="3mf"))
    assert len(file.parts) == 2
    assert len(file.mesh.vertices) == 16
    assert sorted(file.mesh.vertices[part.vertices, 0].mean() for part in file.parts) == [0, 5]


# --- Mistakes ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "data", "expected"),
    [
        ("m.ply", b"", "an empty file"),
        ("m.obj", b"", "an empty file"),
        ("m.blend", b"x", "ending: expected one of obj 3dxml 3mf"),
        ("m", b"x", "got none"),
        ("m.xyz", b"0 0 0\n", "ending"),
        ("m.ply", b"\x89PNG\r\n\x1a\n" + bytes(100), "PLY file, got ValueError: Not a ply file!"),
        ("m.glb", b"a text, not a GLB file", "GLB file"),
        ("m.gltf", b"[]", "glTF 2.0"),
        ("m.gltf", b"[" * 100_000, "GLTF file, got RecursionError"),
        ("m.stl", b"\x89PNG\r\n\x1a\n" + bytes(100), "complete ASCII or binary STL"),
        ("m.off", b"\x89PNG\r\n\x1a\n" + bytes(100), "OFF file"),
        ("m.obj", b"\x89PNG\r\n\x1a\n" + bytes(100), "at least one triangle"),
        ("m.3mf", b"PK\x03\x04 and no archive", "3MF file"),
        ("m.3mf", b"text", "3MF file"),
        ("m.xaml", b"<a", "XAML file"),
        ("m.ply", ply(faces=np.empty((0, 3))), "at least one triangle, got none, and 7 points"),
        ("m.ply", ply(faces=FACES + 5), "indices from 0 to 6"),
        ("m.ply", ply(faces=FACES - 1), "indices from 0 to 6"),
        ("m.ply", ply(vertices=VERTICES * np.nan), "finite coordinates"),
        ("m.ply", ply(vertices=VERTICES + np.inf), "finite coordinates"),
        ("m.ply", ply().replace(b"vertex 7", b"vertex 99999999999999"), "m.ply: "),
        ("m.ply", ascii_ply().replace(b"vertex 7", b"vertex 99999999999999"), "m.ply: "),
        ("m.ply", ascii_ply().replace(b"face 3", b"face 99999999999999"), "99999999999999 rows, got 3"),
        ("m.ply", ply().replace(b"property float z\n", b""), "m.ply: "),
        ("m.ply", ply()[:-1], "element face: expected 3 rows, got an end before that"),
        ("m.ply", ply()[:250], "element vertex: expected 7 rows, got an end before that"),
        ("m.ply", mixed_ply()[:-1], "element face: expected 3 rows, got an end before that"),
        ("m.ply", mixed_ply().replace(b"face 3", b"face 99999999999"), "element face: expected 99999999999 rows"),
        ("m.off", off(faces=FACES + 5), "index outside the range"),
        ("m.off", off(faces=FACES - 1), "index outside the range"),
        ("m.off", off().replace(b"7 3 0", b"7 9 0"), "7 vertices and 9 faces"),
        ("m.stl", stl(np.empty((0, 3, 3))), "at least one triangle"),
        ("m.stl", stl(VERTICES[FACES])[:-1], "complete ASCII or binary STL"),
        ("m.stl", ascii_stl(("one", VERTICES[FACES]), ("two", VERTICES[FACES]))[:-20], "complete ASCII"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line(tmp_path, name, data, expected, capfd):
    assert expected in mistake(tmp_path, name, data)
    assert capfd.readouterr() == ("", "")


def test_the_librarys_log_stays_quiet(tmp_path, caplog):
    data = ascii_stl(("one", VERTICES[FACES])).replace(b"normal 0 0 0", b"normal none at all")
    assert len(read(tmp_path, "m.stl", data).mesh.faces) == 3
    assert caplog.records == []


def test_files_that_are_none(tmp_path):
    (tmp_path / "folder.ply").mkdir()
    os.mkfifo(tmp_path / "pipe.ply")
    for name, expected in {"missing.ply": "got none", "folder.ply": "a folder", "pipe.ply": "regular file"}.items():
        with pytest.raises(MeshError, match=expected):
            load(tmp_path / name)
    with pytest.raises(MeshError, match="too long"):
        load(tmp_path / ("n" * 300))


def test_a_file_that_may_not_be_read(tmp_path, monkeypatch):
    def refuse(*_arguments, **_options):
        raise PermissionError(13, "Permission denied")

    (tmp_path / "m.ply").write_bytes(ply())
    monkeypatch.setattr("pathlib.Path.open", refuse)
    with pytest.raises(MeshError, match=r"m\.ply: file: expected a readable file, got Permission denied"):
        load(tmp_path / "m.ply")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda h: h["accessors"][0].update(count=10**9), "GLB file"),
        (lambda h: h["accessors"][0].update(count=10**15), "GLB file"),
        (lambda h: h["accessors"][0].update(count=-1), "count of at least 1, got -1"),
        (lambda h: h["accessors"][0].pop("bufferView"), "uncompressed values"),
        (lambda h: h["accessors"][0].update(sparse={}), "sparse accessor"),
        (lambda h: h["bufferViews"][0].update(extensions={"EXT_meshopt_compression": {}}), "uncompressed"),
        (lambda h: h["meshes"][0]["primitives"][0].update(mode=6), "triangle fan"),
        (lambda h: h["meshes"][0]["primitives"][0].update(indices=99), "GLB file"),
        (lambda h: h["meshes"][0]["primitives"][0]["attributes"].pop("POSITION"), "GLB file"),
        (lambda h: h["nodes"][0].update(children=[0]), "own ancestor"),
        (lambda h: h["nodes"][0].update(mesh=7), "GLB file"),
        (lambda h: h["nodes"][0].update(scale=[float("nan")] * 3), "finite coordinates"),
        (lambda h: h["scenes"][0].update(nodes=[-1]), "GLB file"),
        (lambda h: h["scenes"][0].update(nodes=[]), "at least one triangle"),
        (lambda h: h.update(nodes=3), "nodes: expected a list"),
        (lambda h: h.update(asset={"version": "1.0"}), "glTF 2.0"),
        (lambda h: h["buffers"][0].update(byteLength=10**9), "1000000000 bytes"),
    ],
)
def test_gltf_mistakes(tmp_path, change, expected):
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, [[0, 1, 2], [0, 2, 3]]))
    header = builder.header | {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    header["buffers"] = [{"uri": "m.bin", "byteLength": len(builder.binary)}]
    (tmp_path / "m.bin").write_bytes(builder.binary)
    change(header)
    message = mistake(tmp_path, "m.gltf", json.dumps(header).encode())
    assert expected.replace("GLB file", "GLTF file") in message


def test_indices_into_a_neighbour_are_refused(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, [[0, 1, 4]]), builder.primitive(TRIANGLE, [[0, 1, 2]]))
    assert "indices from 0 to 2" in mistake(tmp_path, "m.glb", builder.glb([{"mesh": 0, "name": "bad"}]))


@pytest.mark.parametrize(
    ("name", "data"),
    [("m.ply", ply(normals=NORMALS)), ("m.ply", ascii_ply()), ("m.ply", mixed_ply()),
     ("m.obj", obj()), ("m.off", off()), ("m.glb", glb()),
     ("m.stl", stl(VERTICES[FACES])), ("m.stl", ascii_stl(("a", VERTICES[FACES]), ("b", VERTICES[FACES])))],
)  # fmt: skip
def test_files_cut_off_or_damaged_anywhere(tmp_path, name, data):
    """A damaged file is either refused or a mesh: nothing else may come out."""
    rng = np.random.default_rng(7)
    path = tmp_path / name
    for cut in rng.integers(0, len(data), 60):
        path.write_bytes(data[:cut])
        with suppress(MeshError):
            load(path)
    for _ in range(60):
        damaged = np.frombuffer(data, dtype=np.uint8).copy()
        places = rng.integers(0, len(damaged), rng.integers(1, 6))
        damaged[places] = rng.choice(np.frombuffer(b'0123456789- {}[]"\n\x00\xff', np.uint8), len(places))
        path.write_bytes(damaged.tobytes())
        with suppress(MeshError):
            load(path)


# --- Cost --------------------------------------------------------------------------------------------------------


def test_importing_the_loader_does_not_import_trimesh():
    code = "import sys, scenes.load; sys.exit('trimesh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss in KiB")
def test_a_large_mesh_loads_lightly(tmp_path):
    side = 1000
    grid = np.arange(side * side).reshape(side, side)
    a, b, c, d = (part.ravel() for part in (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]))
    y, x = np.divmod(np.arange(side * side), side)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    (tmp_path / "m.ply").write_bytes(ply(np.stack([x, y, np.sin(x)], axis=1), faces))
    code = "import resource, sys; from scenes.load import load; assert len(load(sys.argv[1]).mesh.faces) == 1996002; "
    code += "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)"
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "m.ply"], check=True, capture_output=True, text=True)
    assert int(done.stdout) < 400
