"""Contents of an OBJ file come through a bake: PLY and GLB files keep what they can, and the rest is reported."""

import numpy as np
import PIL.Image
import pytest
from command import obscurance
from gltf_files import check_glb, values
from kept_contents import bake, columns

from obscurance.raytrace.image.texture import texture_alpha
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.obj.mtl import read_mtl
from obscurance.scenes.formats.obj.read import MAX_OBJECTS

OBJ = """mtllib paint.mtl
v 0 0 0 1 0 0
v 1 0 0 0 1 0
v 1 1 0 0 0 1
v 0 1 0 1 1 1
v 0 0 1 .5 .5 .5
v 1 0 1 .5 .5 .5
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vt .25 .75
"""


SEAM = "f 1/1 2/2 3/3 4/4\nf 1/5 2/3 6/1 5/2\n"
NO_SEAM = "f 1/1 2/2 3/3 4/4\nf 1/1 2/2 6/3 5/5\n"
MTL = """newmtl red
Kd .8 .1 .1
map_Kd paint.png
newmtl glass
Kd .2 .3 .4
d .5
Pm .25
Pr .75
Ke 0 .5 0
"""


def write_obj(folder, faces):
    (folder / "m.obj").write_text(OBJ + faces)
    (folder / "paint.mtl").write_text(MTL)
    PIL.Image.new("RGB", (2, 2), (200, 10, 10)).save(folder / "paint.png")


def test_a_ply_keeps_polygons_colours_and_texture_coordinates_of_an_obj(tmp_path):
    write_obj(tmp_path, NO_SEAM)
    printed = bake(tmp_path, "m.obj", "out.ply")
    expected = "w, the openness, is only in the property obscurance; --colors puts it in their place"
    assert printed.startswith(f"warning: out.ply: keeps the colours of m.obj; {expected}\n")
    elements, detail = columns(tmp_path / "out.ply")
    assert detail.sizes.tolist() == [4, 4]
    assert elements["vertex"]["red"].values.tolist() == [255, 0, 0, 255, 128, 128]
    uv = np.stack([elements["vertex"][name].values for name in "st"], axis=1)
    np.testing.assert_array_equal(uv, [[0, 0], [1, 0], [1, 1], [0, 1], [0.25, 0.75], [1, 1]])


def test_texture_coordinates_with_seams_go_to_the_corners_of_a_ply(tmp_path):
    write_obj(tmp_path, SEAM)
    bake(tmp_path, "m.obj", "out.ply")
    elements, detail = columns(tmp_path / "out.ply")
    assert "s" not in elements["vertex"]
    expected = [0, 0, 1, 0, 1, 1, 0, 1, 0.25, 0.75, 1, 1, 0, 0, 1, 0]
    assert elements["face"]["texcoord"].values.tolist() == expected
    assert "texcoord" not in bake(tmp_path, "out.ply", "again.glb")
    header, binary = check_glb((tmp_path / "again.glb").read_bytes())
    uv = values(header, binary, header["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"])
    assert len(uv) == 8
    assert len(detail.corners) == 8


@pytest.mark.parametrize("ending", ["ply", "glb"])
def test_several_normals_of_a_vertex(tmp_path, ending):
    faces = "vn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1//2 6//2 2//2\n"
    (tmp_path / "m.obj").write_text("\n".join(line for line in OBJ.splitlines() if "mtllib" not in line) + "\n" + faces)
    printed = bake(tmp_path, "m.obj", f"out.{ending}")
    assert ("normals of vertices that have several" in printed) == (ending == "ply")
    if ending == "glb":
        header, binary = check_glb((tmp_path / "out.glb").read_bytes())
        (primitive,) = header["meshes"][0]["primitives"]
        normals = values(header, binary, primitive["attributes"]["NORMAL"])
        corners = values(header, binary, primitive["indices"]).reshape(-1, 3)
        np.testing.assert_array_equal(normals[corners], [[[0, 0, 1]] * 3, [[0, 1, 0]] * 3])


def test_a_glb_keeps_materials_textures_and_seams_of_an_obj(tmp_path):
    write_obj(tmp_path, "usemtl red\n" + SEAM.replace("\nf", "\nusemtl glass\nf"))
    printed = bake(tmp_path, "m.obj", "out.glb")
    order = "the order of vertices (_SOURCE_INDEX has their places)"
    assert printed == f"note: out.glb: not kept from m.obj: {order}, polygons, which become triangles\n"
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    one, two = header["meshes"][0]["primitives"]
    names = [header["materials"][piece["material"]] for piece in (one, two)]
    assert [material["name"] for material in names] == ["red", "glass"]
    red, glass = (material["pbrMetallicRoughness"] for material in names)
    assert red["baseColorFactor"] == [0.8, 0.1, 0.1, 1]
    assert glass == {"baseColorFactor": [0.2, 0.3, 0.4, 0.5], "metallicFactor": 0.25, "roughnessFactor": 0.75}
    assert names[1]["alphaMode"] == "BLEND"
    assert names[1]["emissiveFactor"] == [0, 0.5, 0]
    image = header["images"][header["textures"][red["baseColorTexture"]["index"]]["source"]]
    view = header["bufferViews"][image["bufferView"]]
    picture = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    assert picture == (tmp_path / "paint.png").read_bytes()
    uv = values(header, binary, two["attributes"]["TEXCOORD_0"])
    corners = values(header, binary, two["indices"]).reshape(-1, 3)
    np.testing.assert_array_equal(uv[corners][0], [[0.25, 0.25], [1, 0], [0, 1]])
    places = values(header, binary, two["attributes"]["POSITION"])
    np.testing.assert_array_equal(places[corners][0], [[0, 0, 0], [1, 0, 0], [1, 0, 1]])
    colors = values(header, binary, one["attributes"]["COLOR_0"])
    assert sorted(map(tuple, colors.tolist())) == [(0, 0, 1), (0, 1, 0), (1, 0, 0), (1, 1, 1)]


def test_a_material_that_tr_1_would_hide_is_opaque(tmp_path):
    write_obj(tmp_path, "usemtl red\n" + NO_SEAM.replace("\nf", "\nusemtl glass\nf"))
    (tmp_path / "paint.mtl").write_text("newmtl red\nTr 1.000000\nnewmtl glass\nTr .75\nnewmtl clear\nd 0\nTr 1\n")
    printed = bake(tmp_path, "m.obj", "out.glb")
    assert "Tr 1 of red, taken for opaque" in printed
    header, _ = check_glb((tmp_path / "out.glb").read_bytes())
    red, glass = header["materials"][1:]
    assert (red["pbrMetallicRoughness"]["baseColorFactor"][3], "alphaMode" in red) == (1, False)
    assert (glass["pbrMetallicRoughness"]["baseColorFactor"][3], glass["alphaMode"]) == (0.25, "BLEND")
    assert read_mtl(tmp_path / "paint.mtl", lambda _: None)[0]["clear"].opacity == 0
    assert "Tr 1 of red, taken for opaque" in bake(tmp_path, "m.obj", "out.ply")


@pytest.mark.parametrize("given", ["grey", "alpha", "both"])
def test_an_opacity_map_is_the_alpha_of_the_base_colour_texture(tmp_path, given):
    write_obj(tmp_path, "usemtl red\n" + NO_SEAM)
    rng = np.random.default_rng(3)
    alpha = rng.integers(0, 256, (2, 4), np.uint8)
    colour = np.full((2, 4, 4), (200, 10, 10, 255), np.uint8)
    colour[..., 3] = alpha
    maps = {"grey": PIL.Image.fromarray(alpha), "alpha": PIL.Image.fromarray(np.stack([255 - alpha, alpha], axis=2))}
    maps["both"] = PIL.Image.fromarray(colour)
    maps[given].save(tmp_path / "leaf.png")
    own = "leaf.png" if given == "both" else "paint.png"  # of 2 × 2, enlarged
    (tmp_path / "paint.mtl").write_text(f"newmtl red\nmap_d leaf.png\nmap_Kd {own}\n")
    (paint,) = load(tmp_path / "m.obj", "x.glb").materials
    surface = paint.surface(has_uv=True)
    np.testing.assert_allclose(texture_alpha(surface.texture, surface.grey), alpha / 255, atol=1e-6)
    assert "texture" not in bake(tmp_path, "m.obj", "out.glb")
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    assert header["materials"][1]["alphaMode"] == "BLEND"
    view = header["bufferViews"][header["images"][0]["bufferView"]]
    (tmp_path / "in.png").write_bytes(binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]])
    np.testing.assert_array_equal(PIL.Image.open(tmp_path / "in.png"), colour)


def test_images_that_are_no_opacity_maps(tmp_path):
    write_obj(tmp_path, "usemtl red\n" + NO_SEAM)
    (tmp_path / "cut.png").write_bytes((tmp_path / "paint.png").read_bytes()[:-30])
    for line in ("map_d cut.png", "map_d gone.png", "map_d paint.mtl", "map_d paint.png\nmap_Kd paint.png"):
        (tmp_path / "paint.mtl").write_text(f"newmtl red\n{line}\n")
        assert f"texture of {line.splitlines()[0].replace(' ', ' (')})" in bake(tmp_path, "m.obj", "out.glb")
        assert "alphaMode" not in check_glb((tmp_path / "out.glb").read_bytes())[0]["materials"][1]


def test_vertices_without_seams_keep_their_order_in_a_glb(tmp_path):
    write_obj(tmp_path, SEAM)
    bake(tmp_path, "m.obj", "out.glb")
    w = load(tmp_path / "out.glb").mesh.vertices
    np.testing.assert_array_equal(w[:6], load(tmp_path / "m.obj").mesh.vertices)
    np.testing.assert_array_equal(w[6:], [[0, 0, 0], [1, 0, 0]])


OBJECTS = """v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
o floor
g left
usemtl red
f 1 2 3
usemtl glass
f 1 3 4
o wall
g right
f 1 5 6
o floor
usemtl red
f 2 4 3
o
f 1 6 2
"""


def test_objects_of_an_obj_are_nodes_whose_vertices_keep_their_place_in_it(tmp_path):
    (tmp_path / "m.obj").write_text(OBJECTS)
    printed = bake(tmp_path, "m.obj", "out.glb", "--normals", "up")
    assert "names of groups, the order of vertices (_SOURCE_INDEX has their places)" in printed
    assert "its division into objects" in bake(tmp_path, "m.obj", "out.ply")
    source, done = load(tmp_path / "m.obj", "x.glb"), check_glb((tmp_path / "out.glb").read_bytes())
    header = done[0]
    assert source.objects == ("floor", "wall", "m")
    assert [node["name"] for node in header["nodes"]] == ["floor", "wall", "m"]
    assert header["scenes"] == [{"nodes": [0, 1, 2]}]
    assert [len(mesh["primitives"]) for mesh in header["meshes"]] == [2, 1, 1]
    drawn = {}
    for node in header["nodes"]:
        for piece in header["meshes"][node["mesh"]]["primitives"]:
            rows = values(*done, piece["attributes"]["_SOURCE_INDEX"]).astype(int)
            places = values(*done, piece["attributes"]["POSITION"])
            np.testing.assert_array_equal(places, source.mesh.vertices[rows])
            faces = rows[values(*done, piece["indices"]).reshape(-1, 3)]
            drawn[node["name"], header["materials"][piece["material"]]["name"]] = faces.tolist()
    assert drawn == {
        ("floor", "red"): [[0, 1, 2], [1, 3, 2]],
        ("floor", "glass"): [[0, 2, 3]],
        ("wall", "glass"): [[0, 4, 5]],
        ("m", "red"): [[0, 5, 1]],
    }
    again = load(tmp_path / "out.glb")
    rows = np.concatenate(
        [values(*done, p["attributes"]["_SOURCE_INDEX"]) for m in header["meshes"] for p in m["primitives"]]
    )
    bake(tmp_path, "m.obj", "out.npy", "--normals", "up")
    np.testing.assert_array_equal(np.load(tmp_path / "out.npy")[rows.astype(int)], again.w)


@pytest.mark.parametrize("statements", ["o a\ng b", "g b", "g b\no a\ng b"])
def test_the_name_of_a_single_object(tmp_path, statements):
    (tmp_path / "m.obj").write_text(OBJECTS[: OBJECTS.index("o floor")] + statements + "\nf 1 2 3\nf 3 4 1\n")
    assert bake(tmp_path, "m.obj", "out.glb") == ""
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    assert [node["name"] for node in header["nodes"]] == ["a" if "a" in statements else "b"]
    (piece,) = header["meshes"][0]["primitives"]
    np.testing.assert_array_equal(values(header, binary, piece["attributes"]["POSITION"])[5], [1, 0, 1])


def test_objects_beyond_measure_become_one(tmp_path):
    further = "".join(f"o further{number}\nf 1 2 3\n" for number in range(MAX_OBJECTS - 2))
    (tmp_path / "m.obj").write_text(OBJECTS + further)
    source = load(tmp_path / "m.obj", "x.glb")
    assert source.objects == ("m",)
    assert "its division into 4,097 objects" in source.unread
    (tmp_path / "m.obj").write_text(OBJECTS + further.replace("o further0\n", ""))
    assert len(load(tmp_path / "m.obj", "x.glb").objects) == MAX_OBJECTS


def test_twenty_thousand_missing_libraries_are_one_line(tmp_path):
    """Each message had the whole line: 4 GiB."""
    names = " ".join(f"gone{k}.mtl" for k in range(20_000))
    (tmp_path / "m.obj").write_text(f"mtllib {names}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n")
    (note,) = load(tmp_path / "m.obj").notes
    assert note.endswith(
        "material library gone0.mtl, gone1.mtl, gone2.mtl and 19,997 more is not there: what it paints is opaque"
    )


def test_what_is_missing_of_materials_is_reported(tmp_path):
    write_obj(tmp_path, "usemtl red\n" + SEAM)
    (tmp_path / "paint.png").write_text("no picture")
    (tmp_path / "m.obj").write_text((tmp_path / "m.obj").read_text() + "mtllib ../gone.mtl\nl 1 2\n")
    printed = bake(tmp_path, "m.obj", "out.glb")
    for words in (
        "texture of map_Kd (paint.png)",
        "material library ../gone.mtl",
        "lines",
    ):
        assert words in printed
    printed = bake(tmp_path, "m.obj", "out.ply")
    assert "materials" in printed
    assert "texture of" not in printed


def test_materials_and_textures_are_inputs(tmp_path):
    write_obj(tmp_path, "usemtl red\n" + SEAM)
    done = obscurance("bake", tmp_path / "m.obj", "-o", tmp_path / "o.glb", "--debug-image", tmp_path / "paint.png")
    assert done.returncode == 2
    assert "--debug-image: expected a file that is not read" in done.stderr


def test_what_only_some_corners_of_an_obj_have_is_reported(tmp_path):
    write_obj(tmp_path, "vn 0 0 1\ns 1\nf 1/1/1 2/2/1 3/3/1\ns 2\nf 1 3 4\nusemtl a\nf 1 2 6\nusemtl b\nf 1 2 4\n")
    printed = bake(tmp_path, "m.obj", "out.glb")
    assert "9 of 12 normals at corners are missing, zero, not finite or behind their face" in printed
    for words in ("smoothing groups", "vertices that no face uses"):
        assert words in printed
    assert "texture coordinates, which some corners lack" in bake(tmp_path, "m.obj", "out.ply")
    (tmp_path / "c.obj").write_text("v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert "colours, which some vertices lack" in bake(tmp_path, "c.obj", "out.ply")
