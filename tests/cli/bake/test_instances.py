"""Instances of one mesh, which have one layout: a texture for each, their mean or the first's, or charts packed apart.

Of two instances of a square one lies below a lid, whose closed form is known, and the other is open.
"""

import json

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded
from gltf_files import HALVES, QUAD, Builder

from obscurance import ao, scenes
from obscurance.ao.closed_forms import polygon_form_factor
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.formats.gltf.accessors import values

HEIGHT = 0.5
LID = [(-2, -2, HEIGHT), (2, -2, HEIGHT), (2, 2, HEIGHT), (-2, 2, HEIGHT)]
PLACES = (np.arange(16) + 0.5) / 8 - 1
W = 1 - np.array([[polygon_form_factor(LID, (x, -y, 0), (0, 0, 1)) for x in PLACES] for y in PLACES])
"""Of the texels of the square below the lid, by their centres."""
FEW = ("--samples", 64, "--size", 16, "--falloff", "binary", "--max-distance", 9)
UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "<f4")  # downwards: all of the page
OPEN, BELOW = {"mesh": 0, "name": "open", "translation": [99, 0, 0]}, {"mesh": 0, "name": "below"}


def squares(folder, nodes=(OPEN, BELOW), lid_uv=None, meshes=1, **fields):
    """A file of instances of a square, the last of `meshes` alike, and of the lid."""
    builder, path = Builder(), folder / "squares.glb"
    for side, height, uv in (*[(2, 0, UV)] * meshes, (4, HEIGHT, lid_uv)):
        vertices = ((QUAD - (0.5, 0.5, 0)) * side + (0, 0, height)).astype("<f4")
        piece = builder.primitive(vertices, HALVES, material=0 if side == 2 else 1)
        if uv is not None:
            piece["attributes"]["TEXCOORD_0"] = builder.accessor(uv, "VEC2")
        builder.mesh(piece)
    materials = [{"name": "floor"}, {"name": "lid"}]
    path.write_bytes(builder.glb([*nodes, {"mesh": meshes, "name": "lid"}], materials=materials, **fields))
    return path


def bake(*arguments):
    return succeeded("bake", *arguments)


def textures_of(path):
    """Codes of the occlusion textures of the nodes, by their names, as trimesh reads them."""
    scene, found = trimesh.load(path), {}
    for node in scene.graph.nodes_geometry:
        material = scene.geometry[scene.graph[node][1]].visual.material
        found[node] = np.asarray(material.occlusionTexture)
    return found


def image(path):
    return read_image(path)[0]["beauty"][..., 0]


def off(codes, w):
    return abs(codes / 255 - w).max()


def test_each_instance_has_its_own_texture(tmp_path):
    path, made = squares(tmp_path), tmp_path / "w.glb"
    errors = tmp_path / "e.<MATERIAL>.exr"
    result = bake(path, "-o", made, "--occlusion", "texture", *FEW, "--instances", "own", "--error-map", errors)
    found = textures_of(made)
    assert off(found["open"], 1) < 0.003
    assert off(found["below"], W) < 0.04
    assert "w.glb, below: 16" in result.stdout
    assert "overlap" not in result.stderr
    assert sorted(each.name for each in tmp_path.glob("*.exr")) == ["e.below.exr", "e.open.exr"]
    header = scenes.load(made).raw.header
    assert len(header["materials"]) == 3  # the lid's, and one of each square
    positions = {mesh["primitives"][0]["attributes"]["POSITION"] for mesh in header["meshes"]}
    assert len(positions) == 2  # vertices are stored once


def test_own_textures_are_those_of_a_mesh_for_each_to_the_bit(tmp_path):
    mirrored = {"mesh": 0, "name": "mirrored", "translation": [0, 3, 0], "scale": [-1, 1, 1]}
    line = "-o", tmp_path / "w.glb", "--occlusion", "texture", *FEW
    bake(squares(tmp_path, (OPEN, BELOW, mirrored)), *line, "--instances", "own")
    shared = textures_of(tmp_path / "w.glb")
    nodes = [each | {"mesh": number} for number, each in enumerate((OPEN, BELOW, mirrored))]
    bake(squares(tmp_path, nodes, meshes=3), *line)
    for node, codes in textures_of(tmp_path / "w.glb").items():
        assert np.array_equal(codes, shared[node]), node
    assert len({codes.tobytes() for node, codes in shared.items() if node != "lid"}) == 3


@pytest.mark.parametrize(("nodes", "w"), [((OPEN, BELOW), 1), ((BELOW, OPEN), W)])
def test_all_instances_show_the_first(tmp_path, nodes, w):
    path, report = squares(tmp_path, nodes), tmp_path / "r.json"
    line = *FEW, "--instances", "first"
    result = bake(path, "-o", tmp_path / "w.glb", "--occlusion", "texture", *line, "--report", report)
    found = textures_of(tmp_path / "w.glb")
    assert np.array_equal(found["open"], found["below"])
    assert off(found["open"], w) < 0.04
    assert "overlap" not in result.stderr
    assert json.loads(report.read_text())["texture"]["overlapping"] == 0
    bake(path, "-o", tmp_path / "w.<OBJECT>.exr", *line)
    (only,) = tmp_path.glob("w.*.exr")
    assert only.name == f"w.{nodes[0]['name']}.exr"
    assert abs(image(only) - w).max() < 0.04


@pytest.mark.parametrize("instances", ["first", "own"])
def test_the_first_instance_is_the_first_that_gets_w(tmp_path, instances):
    path, made = squares(tmp_path), tmp_path / "w.exr"
    bake(path, "-o", made, *FEW, "--instances", instances, "--receive", "below")
    assert abs(image(made) - W).max() < 0.04


def test_by_default_instances_show_their_mean(tmp_path):
    path, made = squares(tmp_path), tmp_path / "w.glb"
    bake(path, "-o", made, "--occlusion", "texture", *FEW)
    found = textures_of(made)
    assert np.array_equal(found["open"], found["below"])
    assert off(found["open"], (1 + W) / 2) < 0.04
    bake(path, "-o", tmp_path / "again.glb", "--occlusion", "texture", *FEW, "--instances", "mean")
    assert (tmp_path / "again.glb").read_bytes() == made.read_bytes()


def test_images_of_instances_are_named_by_object(tmp_path):
    path, line = squares(tmp_path), (*FEW, "--instances", "own")
    remedy = "bake --output: expected <OBJECT> in its name, or a .glb: instances have a texture each"
    refused(obscurance("bake", path, "-o", tmp_path / "w.exr", *line), remedy)
    assert not list(tmp_path.glob("*.exr"))
    bake(path, "-o", tmp_path / "w.<OBJECT>.exr", *line)
    assert abs(image(tmp_path / "w.open.exr") - 1).max() < 0.003
    assert abs(image(tmp_path / "w.below.exr") - W).max() < 0.04


def test_charts_of_all_objects_are_packed_onto_one_page(tmp_path):
    pytest.importorskip("uvunwrap")
    path, made, report = squares(tmp_path, lid_uv=UV), tmp_path / "w.glb", tmp_path / "r.json"
    line = "--uv", "pack", "--samples", 64, "--size", 64, "--falloff", "binary", "--max-distance", 9
    bake(path, "-o", made, "--occlusion", "texture", *line, "--report", report)
    file = scenes.load(made)
    assert json.loads(report.read_text())["texture"]["overlapping"] == 0
    assert np.array_equal(file.uv, scenes.load(path).uv)
    header = file.raw.header
    textures = {json.dumps(each["occlusionTexture"]) for each in header["materials"]}
    assert textures == {'{"index": 0, "texCoord": 1}'}
    packed = file.texture_coordinates(1) * 64
    sides = np.linalg.norm(packed - np.roll(packed, 1, axis=1), axis=2).max(axis=1) / np.sqrt(2)
    assert np.allclose(sides / [2, 2, 2, 2, 4, 4], sides[0] / 2, rtol=1e-4)  # squares of as many texels per length
    codes = textures_of(made)["open"]
    for part, w in zip(file.parts, (1, W[7:9, 7:9].mean(), 1), strict=True):
        x, y = packed[part.faces].reshape(-1, 2).mean(axis=0).astype(int)  # in the middle
        assert abs(codes[63 - y, x] / 255 - w) < 0.05, part.name
    attributes = header["meshes"][0]["primitives"][0]["attributes"]
    assert values(file.raw, attributes["TEXCOORD_1"], "VEC2").shape == (4, 2)  # no vertex is split


def similar(before, after, areas):
    """How far faces are from their shape, relatively; and texels per area of each."""
    edges = [np.stack([uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], axis=-1) for uv in (before, after)]
    least, most = np.linalg.svd(edges[1] @ np.linalg.inv(edges[0]), compute_uv=False).T[::-1]
    return (most / least - 1).max(), abs(np.linalg.det(edges[1])) / areas


def test_packed_charts_keep_their_shape_and_have_the_same_texels_per_area():
    pytest.importorskip("uvunwrap")
    mesh = trimesh.creation.cylinder(1.0, 2.0, sections=24).subdivide()
    vertices, faces = mesh.vertices, mesh.faces
    chart = np.array([-1, 0, 1])[np.rint(mesh.face_normals[:, 2]).astype(int) + 1]
    uv = vertices[faces][:, :, :2] * [0.3, 0.3] + 0.5  # both lids lie over each other, one is mirrored
    turn = np.unwrap(np.arctan2(*vertices[faces][:, :, 1::-1].transpose(2, 0, 1)), axis=1)
    side = chart == 0
    uv[side] = np.stack([turn, vertices[faces][:, :, 2]], axis=-1)[side] * 0.05  # with fewer texels
    packed = scenes.unwrap((vertices, faces), 256, uv)
    for rows in (chart == 1, chart == -1, side):
        shape, density = similar(uv[rows], packed[rows], mesh.area_faces[rows])
        assert shape < 1e-3
        assert np.allclose(density, density[0], rtol=0.02)
        assert np.isclose(density.mean(), similar(uv, packed, mesh.area_faces)[1].mean(), rtol=0.02)
    baked = ao.bake_texture((vertices, faces), packed, 256, samples=1)
    assert baked.facts.overlapping == baked.facts.mirrored == 0
    assert np.array_equal(scenes.unwrap((vertices, faces), 256, uv), packed)
    uv[chart == 1] = np.nan
    filled = scenes.unwrap((vertices, faces), 256, uv)
    assert similar(uv[side], filled[side], mesh.area_faces[side])[0] < 1e-3
    assert ao.bake_texture((vertices, faces), filled, 256, samples=1).facts.overlapping == 0
    with pytest.raises(ValueError, match="expected shape"):
        scenes.unwrap((vertices, faces), 256, uv[:, :2])


def test_mirrored_halves_that_share_their_fold_are_packed_beside_each_other():
    pytest.importorskip("uvunwrap")
    x, y = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(0, 1, 5))
    vertices = np.stack([x, y, 1 - x**2], axis=-1).reshape(-1, 3)
    corners = np.arange(45).reshape(5, 9)[:-1, :-1].ravel()
    faces = np.concatenate([corners[:, None] + [0, 1, 10], corners[:, None] + [0, 10, 9]])
    uv = np.stack([abs(x), y], axis=-1).reshape(-1, 2)[faces]
    packed = scenes.unwrap((vertices, faces), 128, uv)
    assert similar(uv, packed, np.ones(len(faces)))[0] < 1e-3
    assert ao.bake_texture((vertices, faces), packed, 128, samples=1).facts.overlapping == 0
