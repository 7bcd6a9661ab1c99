"""Materials and textures of mesh files that are rendered alone."""

from math import pi

import numpy as np
import pytest
from command import succeeded
from PIL import Image

from obscurance.raytrace import BlinnPhong, Lambert
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.raytrace.image.read import read_image
from obscurance.scenes import read_scene
from obscurance.scenes.description.description import NEUTRAL, WHITE

PICTURE = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 0]]], np.uint8).repeat(8, 0).repeat(8, 1)
QUADS = """mtllib m.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 2 0 0
v 2 1 0
v 3 0 0
v 3 1 0
v 9 9 9
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl paint
f 1/1 2/2 3/3 4/4
usemtl gloss
f 2 5 6 3
usemtl none
f 5 7 8 6
"""
LIBRARY = "newmtl paint\nmap_Kd p.png\nKd .5 .5 .5\nnewmtl gloss\nKd .2 .4 .6\nKs .9 .8 .7\nNs 50\nKe .1 0 0\n"
VIEW = ("--view", "front", "--width", 96, "--height", 48, "--samples", 4, "--obscurance", "off")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Image.fromarray(PICTURE).save(tmp_path / "p.png")
    (tmp_path / "m.obj").write_text(QUADS)
    (tmp_path / "m.mtl").write_text(LIBRARY)
    return tmp_path


def layer(mesh, name, *options):
    succeeded("render", mesh, "-o", "p.exr", *VIEW, *options)
    return read_image("p.exr")[0][name]


def test_each_material_of_an_obj_is_an_object(folder):
    described = read_scene(folder / "m.obj")
    paint, gloss, none = (item.shape for item in described.scene.objects)
    assert (paint.material, paint.texture.path.name) == (Lambert(albedo=0.5), "p.png")
    np.testing.assert_array_equal(paint.uv[np.lexsort(paint.uv.T)], [[0, 0], [1, 0], [0, 1], [1, 1]])
    k_d, k_s = (tuple(np.divide(each, pi)) for each in ((0.2, 0.4, 0.6), (0.9, 0.8, 0.7)))
    assert gloss.material == BlinnPhong(k_d=k_d, k_s=k_s, k_a=(0.2, 0.4, 0.6), exponent=50, emission=(0.1, 0, 0))
    assert gloss.texture is gloss.uv is None
    assert none.material == Lambert(albedo=1)
    assert {path.name for path in described.files} == {"m.obj", "m.mtl", "p.png"}
    file_vertices, total = described.file_vertices()
    assert total == 9
    places = np.concatenate([item.shape.mesh.vertices for item in described.scene.objects])
    np.testing.assert_array_equal(places[:, 0], np.array([0, 1, 1, 0, 2, 2, 3, 3, 9.0])[file_vertices])


def test_a_picture_of_an_obj_has_the_colours_of_its_glb(folder):
    succeeded("bake", "m.obj", "-o", "m.glb", "--samples", 8)
    shown = layer("m.obj", "albedo")
    is_physical = layer("m.obj", "object_id")[..., 0] != 2  # Blinn–Phong's k_d is Kd over π
    differs = np.abs(shown - layer("m.glb", "albedo"))[is_physical] > 2e-3
    assert differs.mean() < 0.005  # pixels with parts of the other material
    quarters = (decode_srgb(np.array(colour)) / 2 for colour in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)))
    for colour in quarters:
        assert (np.abs(shown - colour).max(axis=2) < 0.01).sum() > 20
    assert layer("m.obj", "specular").max() > 0


def test_w_of_a_file_is_on_every_material(folder):
    w = np.linspace(0, 1, 9)
    np.save("w.npy", w)
    succeeded("render", "m.obj", "-o", "p.exr", *VIEW[:-2], "--baked", "w.npy")
    shown = read_image("p.exr")[0]["obscurance"][24, :, 0]
    seen = shown[shown < 1]
    assert (np.abs(np.diff(seen)) < 0.05).all()  # no jump between the materials
    assert seen.min() < 0.25
    assert seen.max() > 0.7


def test_a_face_without_coordinates_has_its_material_without_the_picture(folder):
    (folder / "m.obj").write_text(QUADS.replace("usemtl gloss\n", ""))
    shapes = [item.shape for item in read_scene(folder / "m.obj").scene.objects]
    assert [(shape.texture is not None, shape.material) for shape in shapes] == [
        (False, Lambert(albedo=0.5)),
        (True, Lambert(albedo=0.5)),
        (False, Lambert(albedo=1)),
    ]


def test_faces_of_a_mesh_with_normals_keep_them(folder):
    text = QUADS.replace("vt 0 0\n", "vn 0 .6 .8\nvt 0 0\n")
    text = "\n".join(
        " ".join(["f", *(each + ("//1" if "/" not in each else "/1") for each in line.split()[1:])])
        if line.startswith("f ")
        else line
        for line in text.split("\n")
    )
    (folder / "m.obj").write_text(text)
    for item in read_scene(folder / "m.obj").scene.objects:
        np.testing.assert_allclose(item.shape.mesh.normals, [[0, 0.6, 0.8]] * len(item.shape.mesh.vertices))


def ply(folder, header="", row="", names=("p.png",)):
    comments = "".join(f"comment TextureFile {name}\n" for name in names)
    vertices = "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n"
    (folder / "t.ply").write_text(
        f"ply\nformat ascii 1.0\n{comments}element vertex 4\n"
        + "".join(f"property float {name}\n" for name in "xyzst")
        + f"element face 2\nproperty list uchar int vertex_indices\n{header}end_header\n"
        + f"{vertices}3 0 1 2{row}\n3 0 2 3 1\n"
    )
    return read_scene(folder / "t.ply")


def test_the_texture_that_a_ply_names_is_shown(folder):
    described = ply(folder, "property int texnumber\n", " 0", ("p.png", "q.png"))
    first, second = (item.shape for item in described.scene.objects)
    assert (first.texture.path.name, first.material, second.texture) == ("p.png", WHITE, None)
    assert {path.name for path in described.files} == {"t.ply", "p.png"}
    assert len(np.unique(layer("t.ply", "albedo").round(1).reshape(-1, 3), axis=0)) >= 3
    for target in ("t.glb", "t.html", "u.ply"):
        succeeded("bake", "t.ply", "-o", target, "--samples", 8)
    assert b"baseColorTexture" in (folder / "t.glb").read_bytes()
    assert b"comment TextureFile p.png\ncomment TextureFile q.png\n" in (folder / "u.ply").read_bytes()


def test_a_texture_may_be_named_with_a_backslash(folder):
    (folder / "sub").mkdir()
    (folder / "sub" / "p.png").write_bytes((folder / "p.png").read_bytes())
    described = ply(folder, "property int texnumber\n", " 0", ("sub\\p.png",))
    assert described.scene.objects[-1].shape.texture.path.parts[-2:] == ("sub", "p.png")


@pytest.mark.parametrize("name", ["gone.png", "../p.png", "t.ply"])
def test_a_texture_that_is_none_is_left_out(folder, name):
    described = ply(folder, "property int texnumber\n", " 0", (name,))
    assert [item.shape.texture for item in described.scene.objects] == [None, None]
    assert described.scene.objects[0].shape.material == NEUTRAL
