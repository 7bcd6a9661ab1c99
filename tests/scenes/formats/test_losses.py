"""Contents of glTF, STL, OFF and 3MF files come through a bake: outputs keep what they can, and report the rest."""

import numpy as np
import pytest
from fuzz_seeds import MODEL, archive
from gltf_files import QUAD, Builder, check_glb, values
from kept_contents import bake, columns
from mesh_files import read, stl

from raytrace.image.srgb import decode_srgb, encode_srgb
from scenes.formats.load import load
from scenes.formats.losses import lost


def test_a_ply_keeps_colours_and_texture_coordinates_of_a_gltf(tmp_path):
    builder = Builder()
    primitive = builder.primitive(QUAD, [[0, 1, 2], [0, 2, 3]])
    primitive["attributes"]["TEXCOORD_0"] = builder.accessor(QUAD[:, :2].copy(), "VEC2")
    primitive["attributes"]["COLOR_0"] = builder.accessor((QUAD * 0.5).astype("<f4"), "VEC3")
    builder.mesh(primitive)
    builder.mesh(builder.primitive(QUAD + np.float32(2), [[0, 1, 2]]))
    data = builder.glb([{"mesh": 0}, {"mesh": 1}], materials=[{"name": "paint"}])
    (tmp_path / "in.glb").write_bytes(data)
    printed = bake(tmp_path, "in.glb", "out.ply")
    assert "not kept from in.glb: nodes, materials\n" in printed
    vertex = columns(tmp_path / "out.ply")[0]["vertex"]
    np.testing.assert_array_equal(vertex["t"].values[:4], 1 - QUAD[:, 1])
    expected = np.rint(255 * encode_srgb(QUAD[:, 0] * 0.5))
    np.testing.assert_array_equal(vertex["red"].values, [*expected, 255, 255, 255, 255])


def test_nothing_is_reported_where_nothing_is_lost(tmp_path):
    (tmp_path / "m.stl").write_bytes(stl(QUAD[[[0, 1, 2], [0, 2, 3]]]))
    for target in ("w.npy", "w.npz", "w.ply", "w.glb"):
        assert bake(tmp_path, "m.stl", target) == ""


def test_polygons_that_cross_themselves_are_reported(tmp_path):
    (tmp_path / "bow.obj").write_text("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n")
    assert "bow.obj: 1 polygon crosses itself" in bake(tmp_path, "bow.obj", "w.npy")


def test_colours_of_an_off_file_are_reported(tmp_path):
    file = read(tmp_path, "m.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n")
    assert "colours" in lost(tmp_path / "w.ply", file)[0]


GROUPS = b"""<resources><basematerials id="7"><base name="PLA" displaycolor="#FF8000"/><base name="glass"
displaycolor="#0000FF80"/></basematerials><colorgroup id="8"><color color="#00FF00FF"/>
<color color="green"/></colorgroup>"""


def painted_3mf(*changes):
    model = MODEL.replace(b"<resources>", GROUPS)
    for old, new in (*changes, (b'id="1" name="one"', b'id="1" name="one" pid="7" pindex="1"')):
        assert old in model
        model = model.replace(old, new)
    return archive(**{"3D/3dmodel.model": model})


def test_materials_of_a_3mf_file_come_into_a_glb(tmp_path):
    changes = (b'v1="0" v2="1" v3="3"', b'v1="0" v2="1" v3="3" pid="8" p1="0"')
    (tmp_path / "m.3mf").write_bytes(painted_3mf(changes))
    order = "the order of vertices (_SOURCE_INDEX has their places)"
    assert bake(tmp_path, "m.3mf", "out.glb") == f"note: out.glb: not kept from m.3mf: {order}\n"
    assert "not kept from m.3mf: its division into objects, materials" in bake(tmp_path, "m.3mf", "out.ply")
    header, binary = check_glb((tmp_path / "out.glb").read_bytes())
    factors = {m["name"]: m["pbrMetallicRoughness"]["baseColorFactor"] for m in header["materials"][1:]}
    assert factors["PLA"] == pytest.approx([1, float(decode_srgb(np.array(128 / 255))), 0, 1])
    assert factors["glass"] == pytest.approx([0, 0, 1, 128 / 255])
    assert factors["#00FF00FF"] == [0, 1, 0, 1]
    source = load(tmp_path / "m.3mf")
    assert len(header["meshes"]) == len(source.parts) == 3
    for mesh, part in zip(header["meshes"], source.parts, strict=True):
        found = {header["materials"][piece["material"]]["name"]: piece for piece in mesh["primitives"]}
        assert list(found) == ["glass", "#00FF00FF"]
        for piece, faces in zip(found.values(), source.mesh.faces[part.faces], strict=True):
            rows = values(header, binary, piece["attributes"]["_SOURCE_INDEX"]).astype(int)
            np.testing.assert_array_equal(rows[values(header, binary, piece["indices"])], faces)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (b'v2="2" v3="1"', b'v2="2" v3="1" pid="8" p1="0" p2="1"', "colours that vary within triangles"),
        (b"<object id", b'<texture2dgroup id="9"/><object id', "materials and colours"),
        (b'v2="2" v3="1"', b'v2="2" v3="1" pid="8" p1="99999999999" p2="x" p3="-1"', None),
        (b'v2="2" v3="1"', b'v2="2" v3="1" pid="70" p1="0"', None),
    ],
)
def test_properties_of_a_3mf_file_that_a_glb_has_no_place_for(tmp_path, old, new, expected):
    (tmp_path / "m.3mf").write_bytes(painted_3mf((old, new)))
    file = load(tmp_path / "m.3mf", "x.glb")
    assert (list(file.unread) == [expected]) if expected else not file.unread
    assert load(tmp_path / "m.3mf").unread == (("materials and colours",))


def test_too_many_colours_of_a_3mf_file_are_reported(tmp_path, monkeypatch):
    monkeypatch.setattr("scenes.formats.threemf.MAX_PAINTS", 3)
    file = read(tmp_path, "m.3mf", painted_3mf())
    (tmp_path / "m.3mf").write_bytes(painted_3mf())
    assert load(tmp_path / "m.3mf", "x.glb").unread == ("its 4 materials and colours",)
    assert "materials and colours" in lost(tmp_path / "w.ply", file)[0]


@pytest.mark.parametrize(("height", "creased"), [(0.25, False), (1, True)])
def test_a_glb_of_a_mesh_without_normals_has_smooth_ones_but_across_creases(tmp_path, height, creased):
    """Two squares that meet at an edge with a seam, and that lie in one plane by less than 30°, or do not."""
    places = [(0, -1, 0), (0, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, -height), (1, 1, -height)]
    vertices = "".join("v {} {} {}\n".format(*place) for place in places) + "vt 0 0\nvt 1 1\n"
    for seam in (False, True):
        faces = "f 1/1 2/1 3/1 4/1\nf 1/2 5/2 6/2 2/2\n" if seam else "f 1 2 3 4\nf 1 5 6 2\n"
        (tmp_path / "m.obj").write_text(vertices + faces)
        assert "error" not in bake(tmp_path, "m.obj", "out.glb")
        header, binary = check_glb((tmp_path / "out.glb").read_bytes())
        (primitive,) = header["meshes"][0]["primitives"]
        found = {name: values(header, binary, number) for name, number in primitive["attributes"].items()}
        rows = [0, 1, 2, 3, 4, 5, *([0, 1] if seam or creased else [])]
        np.testing.assert_array_equal(found["POSITION"], np.float32(places)[rows])
        np.testing.assert_array_equal(found["_OBSCURANCE"], found["_OBSCURANCE"][rows])
        np.testing.assert_allclose(np.linalg.norm(found["NORMAL"], axis=1), 1, atol=1e-6)
        if len(rows) > 6:
            turned = np.degrees(np.arccos((found["NORMAL"][0] * found["NORMAL"][6]).sum().clip(-1, 1)))
            assert turned == pytest.approx(np.degrees(np.arctan(height)) if creased else 0, abs=0.1)
