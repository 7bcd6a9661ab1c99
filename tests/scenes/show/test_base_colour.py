"""Base colours in pages: what a page holds of materials, vertices and textures, and what a browser draws."""

import base64
import io

import numpy as np
import pytest
from browser_pages import opened, shown
from command import succeeded
from gltf_files import Builder
from pages import columns_of, faces_of, facts_of
from PIL import Image

from benchmarks.pictures import chromium
from obscurance.raytrace.image.colour import encode_srgb
from obscurance.scenes.formats.load import load
from obscurance.scenes.show.page.base_colour import base_colour, shrunk
from obscurance.scenes.show.page.document import html_page

WALL = """mtllib wall.mtl
v -2 -1 0\nv 0 -1 0\nv 2 -1 0\nv 2 1 0\nv 0 1 0\nv -2 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
usemtl paint\nf 1/1 2/2 5/3 6/4\nusemtl plain\nf 2/1 3/2 4/3 5/4\n"""
MATERIALS = "newmtl paint\nKd .5 .5 .5\nmap_Kd paint.png\nnewmtl plain\nKd 0 .25 1\n"
VIEW = "#mode=colour&position=0,0,5&target=0,0,0"
GREY = round(255 * float(encode_srgb(0.5)))


@pytest.fixture
def wall(tmp_path, monkeypatch):
    """Two squares of two materials that share an edge, one with a picture: its left half red, its right half green."""
    monkeypatch.chdir(tmp_path)
    pixels = np.zeros((4, 4, 3), np.uint8)
    pixels[:, :2, 0] = pixels[:, 2:, 1] = 255
    Image.fromarray(pixels).save(tmp_path / "paint.png")
    (tmp_path / "wall.mtl").write_text(MATERIALS)
    (tmp_path / "wall.obj").write_text(WALL)
    return tmp_path


def page_of(path, *arguments):
    succeeded(*arguments)
    return path.read_bytes()


def test_a_page_holds_colours_coordinates_and_the_image_as_it_is(wall):
    page = page_of(wall / "p.html", "bake", "wall.obj", "-o", "p.html", "--samples", 16)
    facts, columns = facts_of(page), columns_of(page)
    assert columns["image0"].tobytes() == (wall / "paint.png").read_bytes()
    assert facts["draws"] == [[2, -1, -1], [2, -1, 0]]
    assert facts["base"]["wraps"] == [["repeat", "repeat"]]
    codes = {tuple(row) for row in columns["base"].reshape(-1, 3).tolist()}
    assert codes == {(GREY, GREY, GREY), (0, round(255 * float(encode_srgb(0.25))), 255)}
    assert len(columns["base"]) == 3 * (6 + 2)  # the edge is stored once for each material
    faces = faces_of({"faces": columns["faces"].astype(np.int64)}) % 2**32  # another image begins at a lower vertex
    assert sorted(map(sorted, faces.tolist())) == sorted(map(sorted, load("wall.obj").mesh.faces.tolist()))
    again = page_of(wall / "p.html", "bake", "wall.obj", "-o", "p.html", "--samples", 16)
    assert again == page


def test_w_and_arrays_of_a_mesh_are_seen_in_its_colours(wall):
    succeeded("bake", "wall.obj", "-o", "w.npz", "--samples", 16)
    succeeded("bake", "wall.obj", "-o", "w.glb", "--samples", 16)
    for arguments in (("w.npz", "--mesh", "wall.obj"), ("w.glb",)):
        page = page_of(wall / "p.html", "view", *arguments, "-o", "p.html")
        assert facts_of(page)["draws"][-1][-1] == 0
        assert columns_of(page)["image0"].tobytes() == (wall / "paint.png").read_bytes()


@pytest.mark.parametrize("colours", [False, True])
def test_colours_of_vertices_are_shown_and_the_grey_of_w_is_none(tmp_path, monkeypatch, colours):
    monkeypatch.chdir(tmp_path)
    rows = [(0, 0, 0, 1, 0, 0), (1, 0, 0, 0, 1, 0), (0, 1, 0, 0, 0, 1)]
    lines = "".join("v {} {} {}{}\n".format(*row[:3], " {} {} {}".format(*row[3:]) if colours else "") for row in rows)
    (tmp_path / "m.obj").write_text(lines + "f 1 2 3\n")
    succeeded("bake", "m.obj", "-o", "m.ply", "--samples", 8)
    for name in ("m.obj", "m.ply"):
        base = base_colour(load(name, "page.html"))
        if colours:
            np.testing.assert_array_equal(base.codes[0], 255 * np.eye(3))
        else:
            assert base is None


def test_factors_and_colours_of_a_gltf_are_multiplied_and_alpha_of_opaque_materials_is_left_out(tmp_path):
    builder = Builder()
    colours = builder.accessor(np.array([[1, 1, 1, 0.5], [0, 1, 1, 1], [1, 0, 1, 1]], "<f4"), "VEC4")
    primitive = builder.primitive(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4"), [[0, 1, 2]])
    primitive["attributes"]["COLOR_0"] = colours
    primitive["material"] = 0
    builder.header["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 1]}}]
    builder.mesh(primitive)
    (tmp_path / "m.glb").write_bytes(builder.glb([{"mesh": 0}]))
    base = base_colour(load(tmp_path / "m.glb"))
    light = np.array([[1, 0.5, 0.25], [0, 0.5, 0.25], [1, 0, 0.25]])
    np.testing.assert_array_equal(base.codes[0], np.rint(255 * encode_srgb(light)))
    assert base.alpha is None


@pytest.mark.parametrize(
    ("mode", "alpha"), [({"alphaMode": "BLEND"}, 128), ({"alphaMode": "MASK"}, 255), ({"alphaMode": "OPAQUE"}, None)]
)
def test_images_of_a_gltf_keep_their_alpha_where_it_counts(tmp_path, mode, alpha):
    pixels = np.full((4, 4, 4), 128, np.uint8)
    pixels[:2, :, 3] = 100
    content = io.BytesIO()
    Image.fromarray(pixels).save(content, "PNG")
    builder = Builder()
    primitive = builder.primitive(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4"), [[0, 1, 2]])
    primitive["attributes"]["TEXCOORD_0"] = builder.accessor(np.eye(3, 2).astype("<f4"), "VEC2")
    primitive["material"] = 0
    image = "data:image/png;base64," + base64.b64encode(content.getvalue()).decode()
    builder.header |= {"images": [{"uri": image}], "textures": [{"source": 0}]}
    factors = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 128 / 255]}
    builder.header["materials"] = [{"pbrMetallicRoughness": factors, "alphaCutoff": 0.22, **mode}]
    builder.mesh(primitive)
    (tmp_path / "m.glb").write_bytes(builder.glb([{"mesh": 0}]))
    base = base_colour(load(tmp_path / "m.glb"))
    stored = np.asarray(Image.open(io.BytesIO(base.images[0])))
    if alpha is None:
        assert base.alpha is None
        assert stored.shape == (4, 4, 3)
        return
    assert (base.alpha == alpha).all()
    expected = {"BLEND": (100, 128), "MASK": (0, 255)}[mode["alphaMode"]]
    assert (stored[0, 0, 3], stored[3, 3, 3]) == expected
    assert (stored[..., :3] == 128).all()
    assert "alpha" in columns_of(html_page(load(tmp_path / "m.glb").mesh, np.ones(3), base=base))


def test_large_images_are_shrunk_and_a_page_stays_small(wall):
    noise = np.random.default_rng(1).integers(0, 255, (1100, 2100, 3), np.uint8)
    Image.fromarray(noise).save(wall / "paint.png")
    (stored,) = base_colour(load("wall.obj", "page.html")).images
    small = Image.open(io.BytesIO(stored))
    assert (small.format, small.size) == ("JPEG", (700, 550))
    assert len(stored) < 720_000
    mean = np.asarray(shrunk(noise, 1024), float)
    assert abs(np.asarray(small, float) - mean).mean() < 4
    np.testing.assert_allclose(mean[0, 0], noise[:2, :2].reshape(-1, 3).mean(axis=0), atol=60)


def test_an_image_that_cannot_be_read_leaves_a_page_without_colours(wall):
    (wall / "paint.png").write_bytes(b"\x89PNG\r\n\x1a\nno")
    page = page_of(wall / "p.html", "bake", "wall.obj", "-o", "p.html", "--samples", 8)
    assert facts_of(page)["base"] is None
    assert "paint.png" in facts_of(page)["baseMissing"]


@pytest.mark.skipif(chromium.MISSING is not None, reason=str(chromium.MISSING))
def test_a_browser_draws_them_times_light_and_w(wall, tab):
    succeeded("bake", "wall.obj", "-o", "w.npz", "--samples", 8)
    for w in (1.0, 0.5):
        np.savez("half.npz", w=np.full(6, w, np.float32))
        page_of(wall / "p.html", "view", "half.npz", "--mesh", "wall.obj", "-o", "p.html")
        opened(tab, (wall / "p.html").as_uri() + VIEW)
        picture = shown(tab, wall)
        light = w * (0.4 + 0.85 * 0.66 / np.linalg.norm([0.45, 0.6, 0.66]))
        middle = picture[picture.shape[0] // 2]
        for place, albedo in ((0.2, (0.5, 0, 0)), (0.4, (0, 0.5, 0)), (0.7, (0, 0.25, 1))):
            found = middle[int(place * len(middle))]
            np.testing.assert_allclose(found, encode_srgb(light * np.array(albedo)), atol=0.02)
        assert tab.messages == []
    tab.press("1")
    clay = shown(tab, wall)
    assert abs(clay - picture).mean() > 0.05
    tab.press("7")
    np.testing.assert_array_equal(shown(tab, wall), picture)


@pytest.mark.skipif(chromium.MISSING is not None, reason=str(chromium.MISSING))
def test_a_browser_shows_what_is_behind_holes_and_glass(wall, tab):
    """The left square has a hole in its right half, the right one is a third there; a white wall is behind."""
    pixels = np.zeros((4, 4), np.uint8)
    pixels[:, :2] = 255
    Image.fromarray(pixels).save(wall / "hole.png")
    (wall / "wall.mtl").write_text("newmtl paint\nKd 0 0 0\nmap_d hole.png\nnewmtl plain\nKd 0 0 0\nd 0.333\n")
    behind = "v -9 -9 -1\nv 9 -9 -1\nv 9 9 -1\nv -9 9 -1\nusemtl white\nf 7 8 9 10\n"
    (wall / "wall.obj").write_text(WALL + behind)
    np.savez("w.npz", w=np.ones(10, np.float32))
    page = page_of(wall / "p.html", "view", "w.npz", "--mesh", "wall.obj", "-o", "p.html")
    assert facts_of(page)["draws"][-1] == [2, -1, 0]
    opened(tab, (wall / "p.html").as_uri() + VIEW)
    picture = shown(tab, wall)
    height, width = picture.shape[:2]
    middle = picture[height // 2 - 20 : height // 2 + 20, :, 1]
    light = float(encode_srgb(0.4 + 0.85 * 0.66 / np.linalg.norm([0.45, 0.6, 0.66])))
    for place, expected in ((0.2, 0.0), (0.4, light), (0.7, 0.667 * light)):
        found = middle[:, int(place * width) - 20 : int(place * width) + 20]
        assert found.mean() == pytest.approx(expected, abs=0.03)
    assert tab.messages == []
