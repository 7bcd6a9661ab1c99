"""Alpha of glTF and OBJ materials in mesh files, from the file to w."""

import base64
import io
import re

import numpy as np
import PIL.Image
import pytest
from command import obscurance, succeeded
from gltf_files import check_glb, values
from leaf_cards import FLOOR, HEIGHT, SQUARE, UP, card_glb, card_obj, form_factors, leaf_codes

from obscurance import ao
from obscurance.ao.closed_forms import polygon_form_factor
from obscurance.raytrace import InputError
from obscurance.scenes import load, read_scene, write
from obscurance.scenes.show.page.base_colour import base_colour

MASK = {"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
MOVED = {"texCoord": 0, "extensions": {"KHR_texture_transform": {"offset": [0.25, 0], "scale": [0.5, 1]}}}
BLEND = {"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.3]}}
LEAF = leaf_codes()  # whose red is 200


def glass(factor, texture=None, **fields):
    """A material that transmits a share of the light."""
    return fields | {"extensions": {"KHR_materials_transmission": {"transmissionFactor": factor} | (texture or {})}}


def w_of_floor(path, **options):
    return ao.bake(load(path, **options).mesh, "binary", 4096, denoise=False).w[: len(FLOOR)]


def glb(folder, *arguments, **options):
    (folder / "card.glb").write_bytes(card_glb(*arguments, **options))
    return folder / "card.glb"


def textured(mode, reference=None, **fields):
    return {"alphaMode": mode, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0} | (reference or {})}} | fields


FILES = {
    "cut out": (lambda folder: glb(folder, MASK, LEAF), 1.0, 0.0),
    "cutoff": (lambda folder: glb(folder, MASK | {"alphaCutoff": 0.7}, leaf_codes(0.6)), 0.0, None),
    "blended by the texture": (lambda folder: glb(folder, textured("BLEND"), leaf_codes(0.6)), 0.6, 0.0),
    "blended by the factor": (lambda folder: glb(folder, BLEND), 0.3, None),
    "moved texture": (lambda folder: glb(folder, textured("MASK", MOVED), LEAF), 1.0, 0.0),
    "mirrored": (lambda folder: glb(folder, MASK, LEAF[:, ::-1], scale=[-1, 1, 1]), 1.0, 0.0),
    "opaque": (lambda folder: glb(folder, textured("OPAQUE"), LEAF), 1.0, None),
    "colours": (lambda folder: glb(folder, {"alphaMode": "BLEND"}, colours=[[1, 1, 1, 0.2]] * 4), 0.2, None),
    "transmitting": (lambda folder: glb(folder, glass(0.6)), 0.4, None),
    "all of it transmitting": (lambda folder: glb(folder, glass(1)), 0.0, None),
    "blended and transmitting": (lambda folder: glb(folder, glass(0.6, **BLEND)), 0.12, None),
    "transmitting by the mean of a texture": (
        lambda folder: glb(folder, glass(0.6, {"transmissionTexture": {"index": 0}}), LEAF),
        1 - 0.6 * 200 / 255,
        None,
    ),
    "OBJ's d": (lambda folder: card_obj(folder, "d 0.3"), 0.3, None),
    "OBJ's Tr": (lambda folder: card_obj(folder, "Tr 0.7"), 0.3, None),
    "OBJ's map_d by alpha": (lambda folder: card_obj(folder, "map_d leaf.png", leaf_codes(0.6)), 0.6, 0.0),
    "OBJ's map_d behind options": (
        lambda folder: card_obj(folder, "map_d -s 1 1.0 1 -clamp off -bm .5 leaf.png", leaf_codes(0.6)),
        0.6,
        0.0,
    ),
    "OBJ's map_d by grey": (lambda folder: card_obj(folder, "d 0.5\nmap_d leaf.png", LEAF[..., 3]), 0.5, 0.0),
}


@pytest.mark.parametrize("name", FILES)
def test_w_under_a_card_from_a_file(tmp_path, name):
    make, alpha, right = FILES[name]
    path = make(tmp_path)
    assert np.allclose(w_of_floor(path), 1 - alpha * form_factors(right=right), atol=0.01)
    assert np.allclose(w_of_floor(path, alpha=False), 1 - form_factors(), atol=0.01)


@pytest.mark.parametrize(("material", "alpha"), [("map_d leaf.png", 1.0), ("d 0.5\nmap_d leaf.png", 0.5)])
def test_faces_without_texture_coordinates_leave_the_alpha_of_others(tmp_path, material, alpha):
    """The floor has none, nor has one half of the card: there, d alone holds."""
    path = card_obj(tmp_path, material, np.zeros((4, 4), np.uint8))
    text = path.read_text().replace("f 26/1 27/2 28/3 29/4", "f 26/1 27/2 28/3\nf 26 28 29")
    path.write_text(re.sub(r"^(f \d+)/1 (\d+)/1 (\d+)/1$", r"\1 \2 \3", text, flags=re.MULTILINE))
    half = [polygon_form_factor(np.column_stack([SQUARE[[0, 2, 3]], np.full(3, HEIGHT)]), at, UP) for at in FLOOR]
    assert np.allclose(w_of_floor(path), 1 - alpha * np.array(half), atol=0.01)
    source = load(path, tmp_path / "card.glb")
    write(tmp_path / "card.glb", ao.bake(source.mesh, samples=1), source, occlusion="none")
    header, binary = check_glb((tmp_path / "card.glb").read_bytes())
    drawn = {header["materials"][each["material"]]["name"]: each for each in header["meshes"][0]["primitives"]}
    assert "TEXCOORD_0" not in drawn["floor"]["attributes"]
    found = values(header, binary, drawn["leaf"]["attributes"]["TEXCOORD_0"])
    assert {tuple(row) for row in found.tolist()} == {(0, 1), (1, 0), (1, 1)}


def test_texture_indices_of_a_file_without_texture_coordinates_are_ignored_with_a_note(tmp_path):
    (tmp_path / "cube.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1\n")
    for command, output in (("bake", "w.npy"), ("bake", "w.glb"), ("render", "o.png")):
        done = succeeded(command, tmp_path / "cube.obj", "-o", tmp_path / output, "--samples", 4)
        assert "3 of 3 indices of vt are ignored: the file has 0 lines vt" in done.stderr


def test_an_opaque_file_has_no_alpha(tmp_path):
    for path in (glb(tmp_path, textured("OPAQUE"), LEAF), card_obj(tmp_path, "d 1")):
        assert load(path).mesh.opacity is None


@pytest.mark.parametrize(
    ("material", "field"),
    [
        (MASK | {"alphaCutoff": 1.5}, r"materials\[0\].alphaCutoff: expected .* got 1.5"),
        (MASK | {"alphaCutoff": -0.5}, r"materials\[0\].alphaCutoff: expected .* got -0.5"),
        (MASK | {"alphaMode": "SOLID"}, r"materials\[0\].alphaMode"),
        ({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, "1"]}}, "baseColorFactor"),
    ],
)
def test_alpha_that_cannot_be_read_is_reported_in_a_line(tmp_path, material, field):
    path = glb(tmp_path, material, LEAF)
    with pytest.raises(InputError, match=field) as refused:
        load(path)
    assert "\n" not in str(refused.value)
    assert load(path, alpha=False).mesh.opacity is None


def test_what_of_transmission_is_not_read_is_said(tmp_path):
    path = glb(tmp_path, glass(0.6, **MASK), LEAF)
    (note,) = load(path).notes
    assert note.endswith("materials[0]: KHR_materials_transmission of what is cut out is not read")
    assert np.allclose(w_of_floor(path), 1 - form_factors(right=0.0), atol=0.01)
    texture = {"transmissionTexture": {"index": 0}}
    path = glb(tmp_path, glass(0.6, texture), LEAF, image_fields={"images": [{"uri": "none.png"}]})
    (note,) = load(path).notes
    assert note.endswith('images[0].uri: expected an existing file, got "none.png"; the picture is left out')
    assert np.allclose(w_of_floor(path), 1 - 0.4 * form_factors(), atol=0.01)
    assert load(glb(tmp_path, glass(0))).mesh.opacity is None


def test_pictures_and_pages_see_through_what_transmits(tmp_path):
    path = glb(tmp_path, glass(0.75))
    (card,) = (item for item in read_scene(path).scene.objects if item.shape.mesh.opacity)
    assert card.shape.mesh.opacity.surfaces[0].factor == 0.25
    done = obscurance("render", path, "-o", tmp_path / "p.png", "--width", 8, "--height", 8, "--samples", 1)
    assert (done.returncode, done.stderr) == (0, "")
    assert (base_colour(load(path, "page.html")).alpha == 64).any()


def test_a_missing_picture_leaves_the_alpha_of_the_factor(tmp_path):
    material = textured("BLEND")
    material["pbrMetallicRoughness"]["baseColorFactor"] = [1, 1, 1, 0.3]
    path = glb(tmp_path, material, LEAF, image_fields={"images": [{"uri": "leaf.png"}]})
    (note,) = load(path).notes
    assert note.endswith('images[0].uri: expected an existing file, got "leaf.png"; the picture is left out')
    assert np.allclose(w_of_floor(path), 1 - 0.3 * form_factors(), atol=0.01)
    for command, output in (("bake", "w.npy"), ("render", "o.png"), ("bake", "w.html")):
        done = succeeded(command, path, "-o", tmp_path / output, "--samples", 1)
        assert done.stderr.count(note) == 1


def test_alpha_of_a_webp_is_read(tmp_path):
    stored = io.BytesIO()
    PIL.Image.fromarray(LEAF).save(stored, "WEBP", lossless=True)
    uri = "data:image/webp;base64," + base64.b64encode(stored.getvalue()).decode()
    fields = {"images": [{"uri": uri}], "textures": [{"extensions": {"EXT_texture_webp": {"source": 0}}}]}
    path = glb(tmp_path, textured("MASK"), LEAF, image_fields=fields)
    assert np.allclose(w_of_floor(path), 1 - form_factors(right=0.0), atol=0.01)
    source = load(path, tmp_path / "w.glb")
    assert [source.material(run.material.key).image(0) for run in source.runs()] == [None, 0]
    assert base_colour(load(path, "page.html")).images[0].startswith(b"\x89PNG")
    options = "--occlusion", "texture", "--orm", "--samples", 1, "--size", 16
    orm = obscurance("bake", path, "-o", tmp_path / "w.glb", *options)
    assert "uv" in orm.stderr  # the floor has no coordinates
    succeeded("info", path)


@pytest.mark.parametrize(
    ("extension", "content", "name"),
    [
        ("KHR_texture_basisu", b"\xabKTX 20\xbb\r\n\x1a\n", "KTX2"),
        ("EXT_texture_avif", b"\0\0\0\x20ftypavif", "AVIF"),
    ],
)
def test_alpha_of_a_format_that_is_not_read_is_refused_by_name(tmp_path, extension, content, name):
    uri = "data:image/ktx2;base64," + base64.b64encode(content + bytes(80)).decode()
    fields = {"images": [{"uri": uri}], "textures": [{"extensions": {extension: {"source": 0}}}]}
    path = glb(tmp_path, textured("MASK"), LEAF, image_fields=fields)
    assert "2 faces cut out" in obscurance("info", path).stdout
    for command, output in (("bake", "w.npy"), ("render", "w.png")):
        line = command, path, "-o", tmp_path / output, "--samples", 1
        done = obscurance(*line)
        assert done.returncode == 2
        assert done.stderr.endswith(f"images[0]: content: expected an image, got {name}, which is not read\n")
        done = succeeded(*line, "--alpha", "ignore")
        assert (f"got {extension}; the picture is left out" in done.stderr) == (command == "render")


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ("-s 1 1 1 -o 0 0 -blendu on -mm 0 1", []),
        ("-clamp on", ["-clamp on"]),
        ("-s 2 2 1 -clamp off -imfchan r", ["-s 2 2 1", "-imfchan r"]),
        ("-o .5 -t 0.1 0 0 -mm 0.2 1", ["-o .5", "-t 0.1 0 0", "-mm 0.2 1"]),
    ],
)
def test_options_that_change_an_opacity_map_are_named(tmp_path, options, named):
    path = card_obj(tmp_path, f"map_d {options} 2nd leaf.png", LEAF)
    (tmp_path / "leaf.png").rename(tmp_path / "2nd leaf.png")
    file = load(path)
    assert file.mesh.opacity is not None
    assert [note.split(": ")[1] for note in file.notes] == [
        f"option {option} of map_d (2nd leaf.png) is not read" for option in named
    ]


def test_a_missing_opacity_map_is_reported(tmp_path):
    assert any("map_d (leaf.png)" in note for note in load(card_obj(tmp_path, "map_d leaf.png")).notes)


def test_the_command_reports_and_ignores_alpha(tmp_path):
    path, line = glb(tmp_path, MASK, LEAF), ("-o", tmp_path / "w.npy", "--samples", 256)
    assert "alpha: 2 faces cut out, 0 blended" in succeeded("bake", path, *line).stdout
    cut = np.load(tmp_path / "w.npy")
    assert "alpha" not in succeeded("bake", path, *line, "--alpha", "ignore").stdout
    assert abs(cut - np.load(tmp_path / "w.npy")).max() > 0.1
    path = glb(tmp_path, BLEND)
    assert "0 faces cut out, 2 blended" in obscurance("info", path).stdout
