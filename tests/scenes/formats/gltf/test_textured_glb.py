"""Baked textures in .glb files: by the file's own coordinates, or by new ones for which vertices are split."""

import struct

import numpy as np
import pytest
from gltf_files import HALVES, QUAD, Builder

from obscurance import ao
from obscurance.scenes.formats.gltf.accessors import normalized, values
from obscurance.scenes.formats.gltf.asset import decode
from obscurance.scenes.formats.gltf.occlusion import image_name, occlusion_reference
from obscurance.scenes.formats.gltf.textured import textured_glb
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.stored_w import read_w

UV = np.array([[0.1, 0.9], [0.9, 0.9], [0.9, 0.1], [0.1, 0.1]], "<f4")


def quad(builder, vertices=QUAD, **fields):
    piece = builder.primitive(vertices, HALVES, **fields)
    piece["attributes"]["TEXCOORD_0"] = builder.accessor(UV, "VEC2")
    return piece


def split_uv(mesh):
    """Each face a chart of its own."""
    corner = np.array([[0.1, 0.1], [0.4, 0.15], [0.2, 0.8]])
    return np.stack([corner + np.array([0.5 * (k % 2), 0]) for k in range(len(mesh.faces))])


def written(tmp_path, content):
    path = tmp_path / "out.glb"
    path.write_bytes(content)
    return decode(content, path), load(path, "kept.glb")


def source(tmp_path, content, name="in.glb"):
    path = tmp_path / name
    path.write_bytes(content)
    return load(path, "kept.glb")


def test_coordinates_of_a_file_are_read_upwards(tmp_path):
    builder = Builder()
    builder.mesh(quad(builder))
    file = source(tmp_path, builder.glb([{"mesh": 0}]))
    assert np.allclose(file.uv[0], [[0.1, 0.1], [0.9, 0.1], [0.9, 0.9]])
    assert file.texture_coordinates(1) is None


def test_by_the_own_coordinates_of_a_file(tmp_path):
    builder = Builder()
    builder.mesh(quad(builder, material=0))
    file = source(tmp_path, builder.glb([{"mesh": 0}], materials=[{"name": "kept", "doubleSided": True}]))
    baked = ao.bake_texture(file.mesh, file.uv, 8, samples=8)
    content, warnings = textured_glb(file, [baked])
    asset, again = written(tmp_path, content)
    material = asset.header["materials"][0]
    assert warnings == []
    assert material == {"name": "kept", "doubleSided": True, "occlusionTexture": {"index": 0}}
    assert np.array_equal(again.mesh.vertices, file.mesh.vertices)
    image = asset.header["images"][asset.header["textures"][0]["source"]]
    view = asset.header["bufferViews"][image["bufferView"]]
    png = asset.buffers[0][view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    assert struct.unpack(">IIBB", png[16:26]) == (8, 8, 8, 0)  # 8 × 8, 8 bits, grey


def test_by_new_coordinates_vertices_are_split_with_all_that_they_have(tmp_path):
    builder = Builder()
    normals = np.tile([0.0, 0.0, 1.0], (4, 1))
    piece = quad(builder, normals=normals, material=0)
    piece["attributes"]["JOINTS_0"] = builder.accessor(np.arange(16, dtype="<u1").reshape(4, 4), "VEC4")
    piece["attributes"]["_ODD"] = builder.accessor(np.arange(12, dtype="<u1").reshape(4, 3), "VEC3")
    piece["targets"] = [{"POSITION": builder.accessor(QUAD * 2, "VEC3", min=[0, 0, 0], max=[2, 2, 0])}]
    builder.mesh(piece)
    file = source(tmp_path, builder.glb([{"mesh": 0}], materials=[{}]))
    uv = split_uv(file.mesh)
    baked = ao.bake_texture(file.mesh, uv, 64, samples=8)
    asset, again = written(tmp_path, textured_glb(file, [baked])[0])
    made = asset.header["meshes"][0]["primitives"][0]
    assert asset.header["materials"][0]["occlusionTexture"] == {"index": 0, "texCoord": 1}
    assert len(again.mesh.vertices) == 6
    assert np.array_equal(again.mesh.vertices[again.mesh.faces], file.mesh.vertices[file.mesh.faces])
    assert np.allclose(again.texture_coordinates(1), uv)
    assert np.allclose(again.uv, file.uv)
    old = np.array([int(np.flatnonzero((row == QUAD).all(axis=1))[0]) for row in again.mesh.vertices])
    stored = {name: values(asset, number, asset.header["accessors"][number]["type"])
              for name, number in made["attributes"].items()}  # fmt: skip
    assert np.array_equal(stored["JOINTS_0"], np.arange(16).reshape(4, 4)[old])
    assert np.array_equal(stored["_ODD"], np.arange(12).reshape(4, 3)[old])
    assert np.array_equal(values(asset, made["targets"][0]["POSITION"], "VEC3"), QUAD[old] * 2)
    assert (
        "byteStride" in asset.header["bufferViews"][asset.header["accessors"][made["attributes"]["_ODD"]]["bufferView"]]
    )


def test_mirrored_instances_and_strips_keep_their_corners(tmp_path):
    builder = Builder()
    strip = builder.primitive(QUAD[[0, 1, 3, 2]], mode=5)
    builder.mesh(quad(builder))
    builder.mesh(strip)
    nodes = [
        {"mesh": 0},
        {"mesh": 0, "scale": [-1, 1, 1], "translation": [0, 0, 2]},
        {"mesh": 1, "translation": [3, 0, 0]},
    ]
    file = source(tmp_path, builder.glb(nodes))
    uv = np.stack([np.array([[0.1, 0.1], [0.4, 0.15], [0.2, 0.8]]) / 4 + [(k % 3) / 3, (k // 3) / 2] for k in range(6)])
    baked = ao.bake_texture(file.mesh, uv, 128, samples=8)
    asset, again = written(tmp_path, textured_glb(file, [baked])[0])
    assert np.array_equal(again.mesh.vertices[again.mesh.faces], file.mesh.vertices[file.mesh.faces])
    first = asset.header["meshes"][asset.header["nodes"][0]["mesh"]]["primitives"][0]["attributes"]
    second = asset.header["meshes"][asset.header["nodes"][1]["mesh"]]["primitives"][0]["attributes"]
    assert first["TEXCOORD_1"] != second["TEXCOORD_1"]
    rows = []
    for part, node, name in zip(again.parts, range(3), ("TEXCOORD_1", "TEXCOORD_1", "TEXCOORD_0"), strict=True):
        made = asset.header["meshes"][asset.header["nodes"][node]["mesh"]]["primitives"][0]["attributes"]
        local = again.mesh.faces[part.faces] - part.vertices.start
        down = normalized(values(asset, made[name], "VEC2"))[local]
        rows.append(np.stack([down[..., 0], 1 - down[..., 1]], axis=-1))
    assert np.allclose(np.concatenate(rows), uv, atol=1e-6)


def test_own_occlusion_textures_are_kept_unless_replaced(tmp_path):
    builder = Builder()
    builder.mesh(quad(builder, material=0))
    own = {"occlusionTexture": {"index": 0}}
    fields = {"materials": [own], "textures": [{"source": 0}], "images": [{"uri": "data:image/png;base64,AAAA"}]}
    file = source(tmp_path, builder.glb([{"mesh": 0}], **fields))
    baked = ao.bake_texture(file.mesh, file.uv, 8, samples=8)
    content, (warning,) = textured_glb(file, [baked])
    assert warning.startswith("keeps the file's own occlusion textures (primitives: 1)")
    assert written(tmp_path, content)[0].header["materials"] == [own]
    content, warnings = textured_glb(file, [baked], replace=True)
    assert warnings == []
    assert written(tmp_path, content)[0].header["materials"][0]["occlusionTexture"]["index"] == 1


def test_an_obj_becomes_a_glb_with_its_materials(tmp_path):
    (tmp_path / "m.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    text = ("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\n"
            "usemtl red\nf 1 2 3 4\nusemtl blue\nf 1 5 6 2\n")  # fmt: skip
    file = source(tmp_path, text.encode(), "in.obj")
    uv = np.array([[[0.1, 0.1], [0.4, 0.1], [0.4, 0.4]], [[0.1, 0.1], [0.4, 0.4], [0.1, 0.4]]] * 2)
    uv[2:] += 0.5
    baked = ao.bake_texture(file.mesh, uv, 64, samples=8)
    asset, again = written(tmp_path, textured_glb(file, [baked])[0])
    names = [asset.header["materials"][p["material"]]["name"] for p in asset.header["meshes"][0]["primitives"]]
    assert names == ["red", "blue"]
    assert np.array_equal(again.mesh.vertices[again.mesh.faces], file.mesh.vertices[file.mesh.faces])
    assert np.allclose(again.uv, uv)


@pytest.mark.parametrize("missing", [0, 1])
def test_parts_without_coordinates_get_a_ramp_beside_the_texture_of_others(tmp_path, missing):
    builder = Builder()
    pieces = [quad(builder, material=0), quad(builder, QUAD + np.float32(0.5), material=0)]
    del pieces[missing]["attributes"]["TEXCOORD_0"]
    for piece in pieces:
        builder.mesh(piece)
    file = source(tmp_path, builder.glb([{"mesh": 0}, {"mesh": 1}], materials=[{"name": "one"}]))
    assert np.isnan(file.uv).all(axis=(1, 2)).tolist() == [missing == 0] * 2 + [missing == 1] * 2
    baked, w = ao.bake_texture(file.mesh, file.uv, 8, samples=64), ao.bake(file.mesh, samples=64).w
    content, _ = textured_glb(file, [baked], w=w)
    asset, again = written(tmp_path, content)
    materials = [asset.header["meshes"][k]["primitives"][0]["material"] for k in (0, 1)]
    images = [image_name(asset.header, occlusion_reference(asset.header, material)) for material in materials]
    assert images[missing] == "obscurance ramp"
    assert images[1 - missing] == "obscurance occlusion"
    part = again.parts[missing].vertices
    assert np.abs(read_w(tmp_path / "out.glb", len(w))[part] - w[part]).max() < 1e-5
