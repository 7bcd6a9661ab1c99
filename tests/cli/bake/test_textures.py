"""`obscurance bake` to textures: files, companions, tiles, new coordinates, and one line for each mistake."""

import json
import re

import numpy as np
import pytest
from command import obscurance, refused, succeeded
from mesh_files import obj
from meshes import raw_mesh
from uv_meshes import FLOOR_AND_WALL

from obscurance.raytrace.image.read import read_image
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.stored_w import read_w
from obscurance.scenes.geometry.builtin_shapes import menger

FEW = ("--samples", 16, "--size", 32)


@pytest.fixture
def corner(tmp_path):
    path = tmp_path / "corner.obj"
    path.write_text(FLOOR_AND_WALL)
    return path


def bake(*arguments):
    return succeeded("bake", *arguments)


@pytest.mark.parametrize(("ending", "step"), [(".png", 1 / 65535), (".exr", 0), (".tif", 0)])
def test_every_format_holds_the_same_w(corner, tmp_path, ending, step):
    exact = tmp_path / "exact.exr"
    bake(corner, "-o", exact, *FEW)
    bake(corner, "-o", tmp_path / f"w{ending}", *FEW)
    truth, found = (read_image(path)[0] for path in (exact, tmp_path / f"w{ending}"))
    truth, found = (next(iter(layers.values())) for layers in (truth, found))
    assert found.shape == (32, 32, 1)
    if ending == ".png":  # the reader takes codes without a colour space for sRGB
        import OpenImageIO as oiio

        found = np.asarray(oiio.ImageBuf(str(tmp_path / "w.png")).get_pixels(oiio.UINT16)) / 65535
        assert oiio.ImageBuf(str(tmp_path / "w.png")).spec().format == oiio.UINT16
    assert np.abs(found - truth).max() <= step


def test_summary_report_and_companions(corner, tmp_path):
    files = {"-o": "w.png", "--report": "r.json", "--bent-normals": "n.exr", "--error-map": "e.tif"}
    result = bake(corner, *(word for name, file in files.items() for word in (name, tmp_path / file)), *FEW)
    assert "w.png: 32×32, " in result.stdout or "w.png: 32x32, " in result.stdout
    report = json.loads((tmp_path / "r.json").read_text())
    assert (report["width"], report["height"]) == (32, 32)
    assert report["texture"]["covered"] > 300
    assert report["options"]["size"] == "32"
    normals = next(iter(read_image(tmp_path / "n.exr")[0].values()))
    assert np.allclose(np.linalg.norm(normals, axis=2), 1, atol=1e-5)
    assert normals[24, 16, 2] > 0.9  # over the floor, far from the wall
    assert normals[8, 16, 1] < -0.5  # of the wall
    result = bake(corner, "-o", tmp_path / "up.png", "--normals", "up", *FEW)  # without hard edges
    assert "w, the openness, jumps at the 1 edges of seams by" in result.stdout


def test_the_size_may_be_a_rectangle_or_a_texel(corner, tmp_path):
    path = tmp_path / "w.exr"
    bake(corner, "-o", path, "--samples", 8, "--size", "40x20")
    assert read_image(path)[0]["beauty"].shape == (20, 40, 1)
    bake(corner, "-o", path, "--samples", 8, "--texel-size", 0.05)
    assert read_image(path)[0]["beauty"].shape == (64, 64, 1)


def test_udim_tiles_have_a_file_each(tmp_path):
    path, report = tmp_path / "tiles.obj", tmp_path / "r.json"
    path.write_text(FLOOR_AND_WALL.replace("vt .05 .55\nvt .95 .55\nvt .95 .95\nvt .05 .95",
                                           "vt 1.05 1.55\nvt 1.95 1.55\nvt 1.95 1.95\nvt 1.05 1.95"))  # fmt: skip
    bake(path, "-o", tmp_path / "w.<UDIM>.exr", "--error-map", tmp_path / "e.<UDIM>.exr", *FEW, "--report", report)
    assert sorted(file.name for file in tmp_path.glob("*.exr")) == [
        "e.1001.exr", "e.1012.exr", "w.1001.exr", "w.1012.exr",
    ]  # fmt: skip
    pages = json.loads(report.read_text())["pages"]
    assert [page["texture"]["mirrored"] for page in pages.values()] == [0, 0]
    together = bake(path, "-o", tmp_path / "w.exr", *FEW)
    assert "2 faces reach out of the unit square" in together.stderr


def test_overlaps_are_reported_and_refused(tmp_path):
    path = tmp_path / "twice.obj"
    path.write_text(FLOOR_AND_WALL.replace("4/5 3/6 6/7 5/8", "4/1 3/2 6/3 5/4"))
    result = bake(path, "-o", tmp_path / "w.png", *FEW)
    assert re.search(r"faces overlap in (99|100)\.\d% of the covered texels", result.stderr)
    refused(obscurance("bake", path, "-o", tmp_path / "v.png", *FEW, "--overlap", "refuse"), "do not overlap")
    assert not (tmp_path / "v.png").exists()


def test_new_coordinates_for_a_mesh_without(tmp_path):
    pytest.importorskip("uvunwrap")
    path, made = tmp_path / "bare.obj", tmp_path / "w.glb"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    bake(path, "-o", made, "--occlusion", "texture", "--size", 64, "--samples", 16)
    uv = load(made, "kept.glb").uv
    assert uv.shape == (4, 3, 2)
    assert 0 <= uv.min() < uv.max() <= 1
    picture = tmp_path / "w.png"
    bake(path, "-o", picture, "--uv", "unwrap", "--mesh-output", made, "--size", 64, "--samples", 16)
    assert picture.exists()


def test_w_of_a_fine_mesh_at_vertices(corner, tmp_path):
    fine, target, report = tmp_path / "fine.obj", tmp_path / "w.npz", tmp_path / "r.json"
    fine.write_text("v -1 -1 .01\nv 1 -1 .01\nv 1 1 .01\nv -1 1 .01\nf 1 2 3 4\n")
    result = bake(corner, "--high", fine, "--cage", 0.1, "-o", target, "--samples", 8, "--report", report)
    assert "w.npz: 2 of 6 vertices lie outside the cage of the fine mesh" in result.stderr
    assert "2 of 6 vertices lie outside the cage and take the closest point" in result.stdout
    assert np.load(target)["w"].tolist() == [1] * 6
    assert json.loads(report.read_text())["flagged_vertices"] == {"missed": [4, 5]}


FLAT = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n"


@pytest.mark.parametrize("corners", ["1/1 2 3", "1/1 2/1 3/1"])
@pytest.mark.parametrize(
    "output",
    [
        "-o n.png",
        "-o n.png --dry-run",
        "-o n.png --instances own",
        "-o n.png --report r.json",
        "-o n.glb --occlusion texture --orm",
    ],
)
def test_a_texture_without_any_face_is_refused(tmp_path, monkeypatch, corners, output):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "n.obj").write_text(f"{FLAT}f {corners}\n")
    words = "expected faces with an area on the page, got none"
    refused(obscurance("bake", "n.obj", *output.split()), "n.obj: texture coordinates", words)
    assert [path.name for path in tmp_path.iterdir()] == ["n.obj"]
    batch = obscurance("bake", "n.obj", "--output-dir", "out", "--format", "png")
    assert (batch.returncode, words in batch.stderr) == (1, True)


def test_faces_without_area_on_the_page_get_charts_of_their_own_in_a_glb(tmp_path):
    pytest.importorskip("uvunwrap")
    path, made, dry = tmp_path / "palette.obj", tmp_path / "w.glb", tmp_path / "dry.glb"
    line = "--occlusion", "texture", "--size", 64, "--samples", 64, "--falloff", "binary"
    flat_wall = FLOOR_AND_WALL.replace("f 4/5 3/6 6/7 5/8", "f 4/5 3/5 6/5 5/5")
    path.write_text(f"{flat_wall}v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nf 10/1 9/1 8/1 7/1\n")
    assert "8,192 texels" in bake(path, "-o", dry, *line, "--dry-run").stdout
    result = bake(path, "-o", made, *line, "--report", tmp_path / "r.json")
    assert "show texels of other faces" not in result.stderr
    assert len(json.loads((tmp_path / "r.json").read_text())["pages"]) == 2
    found = load(made)
    sets = [found.texture_coordinates(number) for number in range(2)]
    assert [drawn.primitive_number for drawn in found.raw.drawn] == [0, 1]
    old, new = (part.faces for part in found.parts)
    assert np.allclose(sets[0][old], load(path, "kept.glb").uv[:2], atol=1e-6)
    assert np.ptp(sets[1][new], axis=1).min() > 0.1
    w, corners = read_w(made, len(found.mesh.vertices)), found.mesh.faces[new]
    below = found.mesh.vertices[corners][..., 2] < -0.5
    assert below.sum() == 6
    assert w[corners][below].min() == 1
    assert w[found.mesh.faces[old]].min() < 0.95


@pytest.mark.parametrize("at", [0.2, 0.999999])
def test_coordinates_within_a_millionth_of_the_page(tmp_path, at):
    path, report = tmp_path / "tiny.obj", tmp_path / "r.html"
    rows = [f"vt {at + 1e-6 * x:.9f} {at + 1e-6 * y:.9f}" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    rows.append("f 1/1 2/2 3/3 4/4\nf 4/1 3/2 6/3 5/4\n")
    path.write_text(FLOOR_AND_WALL.partition("vt")[0] + "\n".join(rows))
    result = bake(path, "-o", tmp_path / "w.exr", *FEW, "--report", report)
    assert ", 1 texels covered" in result.stdout
    assert "nan" not in result.stdout
    assert 0.5 < read_image(tmp_path / "w.exr")[0]["beauty"].min() < 1


def test_faces_without_area_on_an_image_are_told(tmp_path):
    path, report = tmp_path / "palette.obj", tmp_path / "r.json"
    path.write_text(FLOOR_AND_WALL.replace("f 4/5 3/6 6/7 5/8", "f 4/5 3/5 6/5 5/5"))
    warned = "2 faces have texture coordinates without area and show texels of other faces"
    assert warned in bake(path, "-o", tmp_path / "w.png", *FEW, "--report", report).stderr
    assert warned in report.read_text()
    glb = "-o", tmp_path / "w.glb", "--occlusion", "texture"
    assert warned in bake(path, *glb, *FEW).stderr  # there is no room for charts on 32 texels
    assert warned in bake(path, *glb, "--orm", "--samples", 16, "--size", 64).stderr
    assert warned in bake(path, "--output-dir", tmp_path / "out", "--format", "png", *FEW).stderr


def test_charts_within_a_texel_get_larger_ones_in_a_glb(tmp_path):
    pytest.importorskip("uvunwrap")
    path, made = tmp_path / "small.obj", tmp_path / "w.glb"
    small = "vt .501 .101\nvt .507 .101\nvt .507 .107\nvt .501 .107\n"
    path.write_text(FLOOR_AND_WALL.replace("f 1/1", f"{small}f 1/1").replace("4/5 3/6 6/7 5/8", "4/9 3/10 6/11 5/12"))
    line = "--samples", 64, "--size", 64, "--falloff", "binary"
    warned = "2 faces have charts smaller than a texel and show texels of other faces"
    assert warned in bake(path, "-o", tmp_path / "w.png", *line).stderr
    assert warned not in bake(path, "-o", made, "--occlusion", "texture", *line).stderr
    found = load(made)
    assert [len(found.mesh.faces[part.faces]) for part in found.parts] == [2, 2]
    assert np.ptp(found.texture_coordinates(1)[found.parts[1].faces], axis=1).min() > 0.1
    fewer = bake(path, "-o", tmp_path / "x.png", "--samples", 8, "--size", 256)
    assert warned not in fewer.stderr


def test_an_object_without_area_on_its_page_is_refused_before_others_are_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    good = "vt 0 0\nvt 1 0\nvt 0 1\no good\nf 1/1 2/2 3/3\n"
    (tmp_path / "two.obj").write_text(f"{FLAT[:-7]}{good}o flat\nf 3/1 2/1 1/1\n")
    words = "two.obj: texture coordinates of flat: expected faces with an area on the page, got none"
    refused(obscurance("bake", "two.obj", "-o", "<OBJECT>.png", "--size", 8), words)
    (tmp_path / "two.obj").write_text((tmp_path / "two.obj").read_text().replace("o flat", "usemtl flat"))
    refused(obscurance("bake", "two.obj", "-o", "<MATERIAL>.png", "--size", 8), words)
    assert [path.name for path in tmp_path.iterdir()] == ["two.obj"]


def test_a_mesh_of_more_charts_than_a_page_has_room_for_is_refused(tmp_path):
    pytest.importorskip("uvunwrap")
    (tmp_path / "m.obj").write_bytes(obj(*raw_mesh(menger(2, 1.0, 1))))
    line = "bake", tmp_path / "m.obj", "-o", tmp_path / "m.glb", "--uv", "unwrap", "--occlusion", "texture"
    refused(obscurance(*line, "--size", 64), "that uvunwrap can unwrap to one page", "pages of 64 texels")


def test_a_panic_of_the_unwrapping_library_is_one_line(tmp_path, monkeypatch):
    """It is no Exception; what ends a process is no panic."""
    library = pytest.importorskip("uvunwrap")
    kind = type("PanicException", (BaseException,), {})

    def fails(*_, **__):
        raise kind("index out of bounds")

    monkeypatch.setattr(library, "generate", fails)
    path = tmp_path / "n.obj"
    path.write_text(f"{FLAT}f 1/1 2/1 3/1\n")
    line = "bake", path, "-o", tmp_path / "n.glb", "--uv", "unwrap", "--occlusion", "texture", "--size", 64
    refused(obscurance(*line), "faces: expected a mesh that uvunwrap can unwrap, got index out of bounds")
    kind = KeyboardInterrupt
    with pytest.raises(kind):
        obscurance(*line)
