"""Contents of a PLY file come through a bake: PLY and GLB files keep what they can, and the rest is reported."""

import numpy as np
from gltf_files import check_glb, values
from kept_contents import bake, columns
from mesh_files import XYZ, ascii_ply, rich_ply

from obscurance.raytrace.image.colour import decode_srgb, encode_srgb
from obscurance.scenes.formats.load import load

LEFT = [f"obscurance_{name}" for name in ("error", "flags", "bent_normals_x", "bent_normals_y", "bent_normals_z")]


def test_a_ply_keeps_everything(tmp_path):
    (tmp_path / "rich.ply").write_bytes(rich_ply())
    printed = bake(tmp_path, "rich.ply", "out.ply")
    before, _ = columns(tmp_path / "rich.ply")
    after, detail = columns(tmp_path / "out.ply")
    assert list(after) == ["vertex", "face", "edge"]
    assert list(after["vertex"]) == [*before["vertex"], "obscurance", *LEFT]
    for element, properties in before.items():
        for name, column in properties.items():
            again = after[element][name]
            assert (again.kind, again.counted) == (column.kind, column.counted)
            np.testing.assert_array_equal(again.values, column.values)
            np.testing.assert_array_equal(again.sizes, column.sizes)
    assert detail.raw.comments == ("comment TextureFile paint.png", "obj_info made by hand", "comment Grüße")
    assert "comment Grüße\n".encode("latin-1") in (tmp_path / "out.ply").read_bytes()
    assert detail.sizes.tolist() == [5, 3, 4]
    assert np.array_equal(load(tmp_path / "out.ply").mesh.faces, load(tmp_path / "rich.ply").mesh.faces)
    assert printed.count("\n") == 2
    assert "2 of 6 vertices lie on hard edges" in printed
    assert "keeps the colours of rich.ply" in printed


def test_comments_keep_their_blanks(tmp_path):
    line = b"comment  two  blanks, and behind \t  \n"
    header, end, rows = ascii_ply().partition(b"end_header\n")
    for ending in (b"\n", b"\r\n"):
        content = (header + line + b"comment up z  \n" + end).replace(b"\n", ending) + rows
        (tmp_path / "m.ply").write_bytes(content)
        bake(tmp_path, "m.ply", "out.ply")
        assert b"\n" + line in (tmp_path / "out.ply").read_bytes()
        assert load(tmp_path / "out.ply").mesh.up == "z"


def test_a_second_bake_of_what_was_baked_replaces_its_w_and_grey(tmp_path):
    (tmp_path / "plain.ply").write_bytes(ascii_ply())
    assert bake(tmp_path, "plain.ply", "one.ply") == ""
    assert bake(tmp_path, "one.ply", "two.ply", "--seed", 5, "--max-distance", 0.1) == ""
    vertex = columns(tmp_path / "two.ply")[0]["vertex"]
    assert list(vertex) == ["x", "y", "z", "obscurance", "red", "green", "blue", *LEFT]
    np.testing.assert_array_equal(vertex["red"].values, np.rint(255 * encode_srgb(vertex["obscurance"].values)))
    assert (tmp_path / "two.ply").read_bytes().count(b"comment obscurance: ") == 1


def test_colors_replaces_the_colours_of_a_ply_and_says_so(tmp_path):
    (tmp_path / "rich.ply").write_bytes(rich_ply())
    assert "not kept from rich.ply: its colours" in bake(tmp_path, "rich.ply", "out.ply", "--colors")
    vertex = columns(tmp_path / "out.ply")[0]["vertex"]
    np.testing.assert_array_equal(vertex["green"].values, np.rint(255 * encode_srgb(vertex["obscurance"].values)))


def test_floats_of_text_stay_floats(tmp_path):
    text = ascii_ply().replace(b"property double", b"property float").replace(b"9.0 9.0 9.0", b"0.1 -1.7e-5 123.456789")
    (tmp_path / "m.ply").write_bytes(text)
    bake(tmp_path, "m.ply", "out.ply")
    vertex = columns(tmp_path / "out.ply")[0]["vertex"]
    assert [vertex[axis].kind for axis in "xyz"] == ["f", "f", "f"]
    np.testing.assert_array_equal([vertex[axis].values[-1] for axis in "xyz"], np.float32([0.1, -1.7e-5, 123.456789]))


def text_ply(rows):
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    head += "property float quality\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    return f"{head}{rows}\n3 0 1 2\n"


def test_numbers_of_text_that_a_type_cannot_hold_get_one_that_can(tmp_path):
    rows = "0 4500000.123 0 .5\n1 4500000.25 0 1e39\n0 4500001 1 2"
    (tmp_path / "m.ply").write_text(text_ply(rows).replace("uchar int", "uchar uchar"))
    bake(tmp_path, "m.ply", "out.ply")
    vertex = columns(tmp_path / "out.ply")[0]["vertex"]
    assert [vertex[name].kind for name in ("x", "y", "z", "quality")] == ["d", "d", "d", "d"]
    assert vertex["y"].values.tolist() == [4500000.123, 4500000.25, 4500001]


def test_quality_of_a_text_file_becomes_an_attribute(tmp_path):
    (tmp_path / "m.ply").write_text(text_ply("0 0.1 0 0.3\n1 0 0 0.25\n0 1 0 0.123457"))
    assert "warning" not in bake(tmp_path, "m.ply", "out.glb")
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    quality = values(header, binary, header["meshes"][0]["primitives"][0]["attributes"]["_QUALITY"])
    np.testing.assert_array_equal(quality, np.float32([0.3, 0.25, 0.123457]))


def test_a_glb_keeps_of_a_ply_what_it_can_and_names_the_rest(tmp_path):
    (tmp_path / "rich.ply").write_bytes(rich_ply())
    printed = bake(tmp_path, "rich.ply", "out.glb")
    rest = "polygons, which become triangles, flags of faces, weights of faces, elements edge"
    assert printed == f"note: out.glb: not kept from rich.ply: {rest}\n"
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    (primitive,) = header["meshes"][0]["primitives"]
    found = {name: values(header, binary, number) for name, number in primitive["attributes"].items()}
    baked = {f"_OBSCURANCE{name}" for name in ("", "_ERROR", "_FLAGS", "_BENT_NORMALS")}
    assert set(found) == {"POSITION", "TEXCOORD_0", "TEXCOORD_1", "COLOR_0", "_QUALITY", "NORMAL", *baked}
    repeated = len(found["NORMAL"]) - 6
    assert repeated > 0
    found = {name: rows[:6] for name, rows in found.items()}
    np.testing.assert_array_equal(found["POSITION"], XYZ)
    np.testing.assert_allclose(found["TEXCOORD_0"], np.stack([np.arange(6) / 8, 1 - np.arange(6) / 4], axis=1))
    np.testing.assert_allclose(found["COLOR_0"][0], [*decode_srgb(np.array([250, 10, 0]) / 255), 1], rtol=1e-6)
    np.testing.assert_array_equal(found["_QUALITY"], np.arange(6) / 2)
