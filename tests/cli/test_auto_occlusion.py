"""`bake --occlusion auto`: a texture where interpolation between the vertices errs, and a ramp elsewhere."""

import re

import numpy as np
from command import obscurance, refused
from mesh_files import obj, ply
from meshes import hills

import scenes
from scenes.geometry.polyhedra import join, polygon

FLOOR = np.array([(-2.0, -2.0, 0.0), (2.0, -2.0, 0.0), (2.0, 2.0, 0.0), (-2.0, 2.0, 0.0)])
LID = FLOOR * (0.4, 0.4, 1) + (0, 0, 0.5)


def textured(apart=0.5, side=0.4, lid=LID):
    """A floor under a lid as OBJ, each a square of the page. Args: apart: of their left sides."""
    lines = [f"v {x} {y} {z}" for x, y, z in (*FLOOR, *lid)]
    for left in (0.0, apart):
        lines += [f"vt {left + u * side} {v * side}" for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))]
    return "\n".join([*lines, "f 1/1 2/2 3/3", "f 1/1 3/3 4/4", "f 5/5 6/6 7/7", "f 5/5 7/7 8/8"])


def bake(folder, name, content, *options):
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return obscurance("bake", folder / name, "-o", folder / "w.glb", "--samples", 32, *options)


def images(folder):
    return [image["name"] for image in scenes.load(folder / "w.glb").gltf.header["images"]]


def test_large_faces_with_texture_coordinates_get_a_texture_and_keep_w_at_the_vertices(tmp_path):
    result = bake(tmp_path, "lid.obj", textured(), "--occlusion", "auto")
    assert result.returncode == 0, result.stderr
    shown = re.search(
        r"\nocclusion: a texture of 512×512: between the vertices w errs by (.*), in textures by (.*)\n", result.stdout
    )
    assert float(shown[1]) > 0.1
    assert float(shown[2]) < 0.02
    assert "between the vertices" not in result.stderr
    assert images(tmp_path) == ["obscurance occlusion"]
    header = scenes.load(tmp_path / "w.glb").gltf.header
    assert all("_OBSCURANCE" in piece["attributes"] for mesh in header["meshes"] for piece in mesh["primitives"])
    found = (tmp_path / "w.glb").read_bytes()
    assert bake(tmp_path, "lid.obj", textured()).returncode == 0
    assert (tmp_path / "w.glb").read_bytes() == found


def test_elsewhere_it_is_the_ramp_byte_by_byte(tmp_path):
    for name, content, coarse in (
        ("lid.ply", ply(*join([polygon(FLOOR), polygon(LID)])), True),
        ("shared.obj", textured(apart=0.0, lid=FLOOR + np.array([0, 0, 0.5])), True),
        ("flat.obj", textured(side=0.0), True),
        ("hills.obj", obj(*hills(70)), False),
    ):
        result = bake(tmp_path, name, content, "--occlusion", "auto")
        assert "occlusion:" not in result.stdout
        assert ("between the vertices w errs" in result.stderr) == coarse
        found = (tmp_path / "w.glb").read_bytes()
        assert bake(tmp_path, name, content, "--occlusion", "ramp").returncode == 0
        assert (tmp_path / "w.glb").read_bytes() == found


def test_what_does_not_go_with_it(tmp_path):
    (tmp_path / "a.ply").write_bytes(ply(*hills(4)))
    line = "bake", tmp_path / "a.ply", "--occlusion", "auto"
    refused(obscurance(*line, "-o", tmp_path / "w.ply"), "bake: --occlusion auto needs a .glb output")
    refused(obscurance(*line, "-o", tmp_path / "w.glb", "--colors"), "bake: --colors does not go with --occlusion auto")
    refused(obscurance(*line, "-o", tmp_path / "w.glb", "--size", 64), "bake: --size needs an image")
