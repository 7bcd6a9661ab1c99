"""Textures of files with several materials, objects and parts without coordinates, by the command and from Python."""

import base64
import json
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from below_a_lid import HEIGHT, LID, UV, W, bake, image, plate
from command import obscurance, refused
from gltf_files import QUAD, Builder

from obscurance import ao, scenes
from obscurance.ao.closed_forms import polygon_form_factor
from obscurance.raytrace.image.write import linear_png
from obscurance.scenes.bake.pages import Layouts, Page
from obscurance.scenes.bake.uv import Coordinates
from obscurance.scenes.formats.gltf.occlusion import image_name, occlusion_reference

FEW = ("--samples", 64, "--size", 16, "--falloff", "binary")


def floor_and_lid(folder, materials=("floor", "lid"), lid_uv=UV, **fields):
    """Two materials with layouts of their own; the lid is open, as the floor below it is smaller and beneath."""
    builder, path = Builder(), folder / "two.glb"
    builder.mesh(plate(builder, 2, 0, material=0))
    builder.mesh(plate(builder, 4, HEIGHT, lid_uv, material=len(materials) - 1))
    nodes = [{"mesh": 0, "name": "low"}, {"mesh": 1, "name": "high"}]
    path.write_bytes(builder.glb(nodes, materials=[{"name": name} for name in materials], **fields))
    return path


def occlusion_of(path):
    """For each primitive drawn: the name of its occlusion texture's image, and w at its corners."""
    file, found = scenes.load(path), []
    w = scenes.read_w(path, len(file.mesh.vertices))
    for drawn, part in zip(file.raw.drawn, file.parts, strict=True):
        primitive = drawn.primitive
        reference = occlusion_reference(file.raw.header, primitive.material)
        assert file.looked_up(part.primitive, file.materials[primitive.material].occlusion)
        found.append((image_name(file.raw.header, reference), reference["index"], w[part.vertices]))
    return found


def test_each_material_has_a_texture_of_its_own_in_a_glb(tmp_path):
    path, made = floor_and_lid(tmp_path), tmp_path / "w.glb"
    result = bake(path, "-o", made, "--occlusion", "texture", *FEW, "--report", tmp_path / "r.json")
    (_, one, low), (_, other, high) = occlusion_of(made)
    assert one != other
    assert abs(low - W[0, 0]).max() < 0.03
    assert high.tolist() == [1] * 4
    assert "w.glb, floor: 16" in result.stdout
    assert "overlap" not in result.stderr
    pages = json.loads((tmp_path / "r.json").read_text())["pages"]
    assert [page["texture"]["covered"] for page in pages.values()] == [256, 256]
    assert [Path(name).name for name in pages] == ["w.glb, floor", "w.glb, lid"]
    line = "-o", made, "--occlusion", "texture", *FEW, "--error-map"
    refused(obscurance("bake", path, *line, tmp_path / "e.exr"), "bake --error-map: expected <MATERIAL> in its name")
    bake(path, *line, tmp_path / "e.<MATERIAL>.exr")
    assert sorted(each.name for each in tmp_path.glob("*.exr")) == ["e.floor.exr", "e.lid.exr"]


def test_names_of_materials_and_objects_in_names_of_files(tmp_path):
    path = floor_and_lid(tmp_path, materials=("../a b", ""))
    errors, report = tmp_path / "e.<MATERIAL>.exr", tmp_path / "r.html"
    bake(path, "-o", tmp_path / "w.<MATERIAL>.exr", "--error-map", errors, "--bent-normals",
         tmp_path / "n.<MATERIAL>.png", "--report", report, *FEW)  # fmt: skip
    names = sorted(each.name for each in tmp_path.iterdir())
    assert names == ["e.a_b.exr", "e.material_1.exr", "n.a_b.png", "n.material_1.png", "r.html", "two.glb",
                     "w.a_b.exr", "w.material_1.exr"]  # fmt: skip
    low = image(tmp_path / "w.a_b.exr")
    assert abs(low - W).max() < 0.03
    assert abs(low - W).mean() < 0.006
    assert image(tmp_path / "w.material_1.exr").min() == 1
    bake(path, "-o", tmp_path / "w.<OBJECT>.exr", *FEW)
    assert np.array_equal(image(tmp_path / "w.low.exr"), low)
    assert (tmp_path / "w.high.exr").exists()


def test_materials_of_one_name_have_files_of_their_own(tmp_path):
    bake(floor_and_lid(tmp_path, materials=("Paint", "paint")), "-o", tmp_path / "w.<MATERIAL>.exr", *FEW)
    assert sorted(each.name for each in tmp_path.glob("*.exr")) == ["w.Paint.exr", "w.paint-2.exr"]


def test_one_image_of_several_layouts_is_refused_unless_their_mean_is_asked_for(tmp_path):
    path, made = floor_and_lid(tmp_path), tmp_path / "w.exr"
    remedy = "two.glb: output: expected <MATERIAL> in its name, a .glb, or --overlap mean"
    refused(obscurance("bake", path, "-o", made, *FEW), remedy, "256 texels", "for both floor and lid")
    assert not made.exists()
    result = bake(path, "-o", made, *FEW, "--overlap", "mean")
    assert abs(image(made).mean() - (1 + W.mean()) / 2) < 0.01
    assert "overlap in 100.0%" in result.stderr


@pytest.mark.parametrize("target", ["w.exr", "w.glb"])
def test_overlaps_are_refused_by_a_few_texels_and_before_anything_else_is_read(tmp_path, target, watch):
    path, fine = floor_and_lid(tmp_path), tmp_path / "fine.obj"
    fine.write_text("no mesh")
    looked_at = watch("obscurance.scenes.bake.pages.shared_texels")
    line = ["bake", path, "-o", tmp_path / target, "--size", 1024, "--high", fine]
    if target == "w.glb":
        line += ["--occlusion", "texture", "--error-map", tmp_path / "e.exr"]
        said = "--error-map: expected <MATERIAL> in its name"
    else:
        said = "got about 1,000,000 texels"
    refused(obscurance(*line), said)
    refused(obscurance(*line, "--dry-run"), said)
    assert [len(texels) <= 1 << 16 for *_, texels in looked_at] == [True, True]
    refused(obscurance("bake", path, "-o", tmp_path / "<MATERIAL>.exr", "--high", fine), "fine.obj: faces: expected")


@pytest.mark.parametrize(("share", "counts"), [(0, 1), (0.003, 1), (0.009, 2), (0.0115, 2), (0.03, 1), (0.5, 1)])
def test_some_texels_say_what_all_would_or_that_they_cannot(tmp_path, share, counts):
    """Counts in 1 MiB of texels: first of some, which say no more than is sure, then of all if there is a doubt."""
    halves = [UV * np.float32([0.5, 1]), UV * np.float32([0.5, 1]) + np.float32([0.5 * (1 - share), 0])]
    builder, path = Builder(), tmp_path / "halves.glb"
    for number, uv in enumerate(halves):
        builder.mesh(plate(builder, 2 + 2 * number, HEIGHT * number, uv, material=number))
    path.write_bytes(builder.glb([{"mesh": 0}, {"mesh": 1}], materials=[{"name": "floor"}, {"name": "lid"}]))
    file = scenes.load(path)
    layouts = Layouts(file, Coordinates(file.uv, np.zeros(len(file.uv), bool), 0, (1024, 1024)))
    found = list(layouts.clashes(Page(file.uv), (1024, 1024), 2))
    assert [about for _, about in found] == ["about ", ""][:counts]
    assert bool(found[-1][0]) == (share > 0.01)
    if share > 0.02:
        np.testing.assert_allclose(found[0][0][0, 1] / 1024**2, share / 2, rtol=0.6)
    elif counts > 1:
        assert found[0][0] == {}


def test_objects_of_a_plain_material_are_kept_apart_and_objects_of_an_image_may_overlap(tmp_path):
    path = floor_and_lid(tmp_path, materials=("grey",))
    refused(obscurance("bake", path, "-o", tmp_path / "w.exr", *FEW), "expected <OBJECT>", "for both low and high")
    bake(path, "-o", tmp_path / "w.glb", "--occlusion", "texture", *FEW)
    (_, one, low), (_, other, high) = occlusion_of(tmp_path / "w.glb")
    assert one != other
    assert high.min() - low.max() > 0.8
    pixel = "data:image/png;base64," + base64.b64encode(linear_png(np.full((1, 1, 1), 255, np.uint8))).decode()
    builder = Builder()
    for side, height in ((2, 0), (4, HEIGHT)):
        builder.mesh(plate(builder, side, height, material=0))
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    nodes, images = [{"mesh": 0}, {"mesh": 1}], {"textures": [{"source": 0}], "images": [{"uri": pixel}]}
    path.write_bytes(builder.glb(nodes, materials=[material], **images))
    assert "overlap in 100.0%" in bake(path, "-o", tmp_path / "w.exr", *FEW).stderr


def test_copies_of_an_object_may_overlap(tmp_path):
    builder, path = Builder(), tmp_path / "copies.glb"
    builder.mesh(plate(builder, 1, 0, material=0))
    nodes = [{"mesh": 0}, {"mesh": 0, "translation": [2, 0, 0]}, {"mesh": 0, "scale": [-1, 1, 1]}]
    path.write_bytes(builder.glb(nodes, materials=[{}]))
    assert "overlap in 100.0%" in bake(path, "-o", tmp_path / "w.exr", *FEW).stderr


def test_layouts_side_by_side_share_one_texture(tmp_path):
    halves = [UV * np.float32([0.5, 1]), UV * np.float32([0.5, 1]) + np.float32([0.5, 0])]
    builder, path = Builder(), tmp_path / "halves.glb"
    for number, uv in enumerate(halves):
        builder.mesh(plate(builder, 2 + 2 * number, HEIGHT * number, uv, material=number))
    path.write_bytes(builder.glb([{"mesh": 0}, {"mesh": 1}], materials=[{"name": "floor"}, {"name": "lid"}]))
    bake(path, "-o", tmp_path / "w.glb", "--occlusion", "texture", *FEW)
    (_, one, _), (_, other, _) = occlusion_of(tmp_path / "w.glb")
    assert one == other
    bake(path, "-o", tmp_path / "w.exr", *FEW)


def test_a_part_without_coordinates_stops_nothing(tmp_path):
    path = floor_and_lid(tmp_path, lid_uv=None)
    result = bake(path, "-o", tmp_path / "w.exr", *FEW)
    faces = "two.glb: 2 faces, of high (lid), have no texture coordinates and"
    assert f"{faces} get no texels; --uv fill with --mesh-output makes some for them" in result.stderr
    assert abs(image(tmp_path / "w.exr") - W).max() < 0.03
    for options in ((), ("--orm",)):
        result = bake(path, "-o", tmp_path / "w.glb", "--occlusion", "texture", *FEW, *options)
        assert f"{faces} show w, the openness, of their vertices; --uv fill makes some" in result.stderr
        (one, _, low), (other, _, high) = occlusion_of(tmp_path / "w.glb")
        assert one in ("obscurance occlusion", "obscurance orm")
        assert other == "obscurance ramp"
        assert abs(low - W[0, 0]).max() < 0.03
        assert np.allclose(high, 1)


def test_faces_of_an_obj_without_coordinates_stop_nothing(tmp_path):
    path, corners = tmp_path / "two.obj", np.concatenate([QUAD - (0.5, 0.5, 0)] * 2) * np.repeat([[2], [4]], 4, axis=0)
    corners[4:, 2] = HEIGHT
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    for mixed in (False, True):
        faces = ["o low", "f 1/1 2/2 3/3", "f 1 3 4" if mixed else "f 1/1 3/3 4/4", "o high", "f 5 6 7 8"]
        path.write_text("\n".join(lines + faces))
        result = bake(path, "-o", tmp_path / "w.glb", "--occlusion", "texture", *FEW)
        named = "low (default), high (default)" if mixed else "high (default)"
        assert f"two.obj: {2 + mixed} faces, of {named}, have no texture coordinates" in result.stderr
        (one, _, low), (other, _, high) = occlusion_of(tmp_path / "w.glb")
        assert one == ("obscurance ramp" if mixed else "obscurance occlusion")
        assert other == "obscurance ramp"
        assert abs(low - (1 - polygon_form_factor(LID, (-1, -1, 0), (0, 0, 1)))).max() < 0.05
        assert np.allclose(high, 1)


def test_coordinates_are_made_for_the_part_that_has_none(tmp_path):
    pytest.importorskip("uvunwrap")
    path, made = floor_and_lid(tmp_path, lid_uv=None), tmp_path / "w.glb"
    bake(path, "-o", made, "--occlusion", "texture", "--uv", "fill", *FEW[:2], "--size", 64, "--falloff", "binary")
    file = scenes.load(made)
    before, after = scenes.load(path).uv, file.uv
    assert np.array_equal(after[:2], before[:2])
    assert np.isfinite(after).all()
    (one, first, low), (other, second, high) = occlusion_of(made)
    assert one == other == "obscurance occlusion"
    assert first != second
    assert abs(low - W[0, 0]).max() < 0.03
    assert np.allclose(high, 1)


def test_tiles_are_offered_where_they_have_numbers(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt {0} 0\nvt {1} 0\nvt {0} 1\nf 1/1 2/2 3/3\n"
    for place, offered in ((1, True), (-1, False), (10, False)):
        (tmp_path / "t.obj").write_text(text.format(place, place + 1))
        result = bake(tmp_path / "t.obj", "-o", tmp_path / "w.exr", *FEW)
        assert "1 faces reach out of the unit square and are taken modulo 1" in result.stderr
        assert ("<UDIM>" in result.stderr) == offered
        if offered:
            bake(tmp_path / "t.obj", "-o", tmp_path / "w.<UDIM>.exr", *FEW)
    result = bake(tmp_path / "t.obj", "-o", tmp_path / "w.glb", "--occlusion", "texture", *FEW)
    assert "<UDIM>" not in result.stderr
    refused(obscurance("bake", tmp_path / "t.obj", "-o", tmp_path / "w.<UDIM>.glb", "--occlusion", "texture"), "<UDIM>")


def test_from_python_in_five_lines(tmp_path, monkeypatch):
    monkeypatch.chdir(floor_and_lid(tmp_path, lid_uv=None).parent)
    file = scenes.load("two.glb")
    baked = ao.bake_texture(file.mesh, file.uv, 16, ao.Binary(), samples=64)
    scenes.write("ao.png", baked, file)
    scenes.write("two_ao.glb", [baked, ao.bake(file.mesh, ao.Binary())], file)
    codes = np.asarray(oiio.ImageBuf("ao.png").get_pixels(oiio.UINT16))[..., 0] / 65535
    assert abs(codes - W).max() < 0.03
    (one, _, low), (other, _, high) = occlusion_of(Path("two_ao.glb"))
    assert (one, other) == ("obscurance occlusion", "obscurance ramp")
    assert abs(low - W[0, 0]).max() < 0.03
    assert np.allclose(high, 1)
    with pytest.raises(ValueError, match="expected a texture of the 4 faces"):
        scenes.write("ao.png", ao.bake_texture(([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), UV[:3], 8), file)
    with pytest.raises(ValueError, match=r"a \.glb, or an image of one texture"):
        scenes.write("ao.png", [baked, baked], file)
