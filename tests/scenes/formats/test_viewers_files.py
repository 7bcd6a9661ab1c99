"""Files for viewers: .vtp, .obj with vertex colours, and a property of a .ply by another name."""

import base64
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded
from mesh_files import POLYGONS, XYZ, rich_ply

from obscurance import scenes
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.scenes.formats.ply.layout import columns_of

KINDS = {"Float32": "<f4", "Float64": "<f8", "Int64": "<i8", "UInt8": "u1"}
OBJ = """v 0 0 0
v 2 0 0
v 2 2 0
v 0 2 0
v 0.1 0 1e-3
vn 0 0 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
f 1/1/1 2/2/1 3/3/1 4/4/1
f 1/2/1 2/1/1 5/3/1
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rich.ply").write_bytes(rich_ply())
    (tmp_path / "m.obj").write_text(OBJ)
    return tmp_path


def bake(*arguments):
    done = succeeded("bake", *arguments, "--samples", 64, "--seed", 1)
    return done.stderr


def vtk_arrays(path):
    """Every array of a .vtp, by its name, read as the format's documentation says."""
    root = ElementTree.parse(path).getroot()
    assert root.attrib == {
        "type": "PolyData", "version": "1.0", "byte_order": "LittleEndian", "header_type": "UInt64"
    }  # fmt: skip
    found = {}
    for array in root.iter("DataArray"):
        data = base64.b64decode(array.text)
        assert int.from_bytes(data[:8], "little") == len(data) - 8
        values = np.frombuffer(data[8:], KINDS[array.attrib["type"]])
        found[array.attrib["Name"]] = values.reshape(-1, int(array.attrib["NumberOfComponents"]))
    return found, root.find("PolyData/Piece")


def test_a_vtp_holds_polygons_and_what_was_baked(folder):
    said = bake("rich.ply", "-o", "rich.vtp")
    bake("rich.ply", "-o", "rich.npz")
    arrays, piece = vtk_arrays(folder / "rich.vtp")
    assert piece.attrib == {"NumberOfPoints": "6", "NumberOfPolys": "3"}
    assert piece.find("PointData").attrib == {"Scalars": "obscurance"}
    np.testing.assert_array_equal(arrays["Points"], XYZ)
    ends = arrays["offsets"].ravel()
    assert [part.tolist() for part in np.split(arrays["connectivity"].ravel(), ends[:-1])] == POLYGONS
    stored = np.load(folder / "rich.npz")
    for name, column in {"obscurance": "w", "error": "error", "flags": "flags", "bent_normals": "bent_normals"}.items():
        np.testing.assert_array_equal(arrays[name].squeeze(), stored[column])
    assert "not kept from rich.ply: its colours, quality of vertices, texture coordinates" in said


def test_pyvista_reads_a_vtp(folder):
    pyvista = pytest.importorskip("pyvista")
    bake("m.obj", "-o", "m.vtp")
    surface = pyvista.read("m.vtp")
    assert (surface.n_points, surface.n_cells) == (5, 2)
    np.testing.assert_array_equal(surface["obscurance"], vtk_arrays("m.vtp")[0]["obscurance"].ravel())


def test_an_obj_has_w_as_colours_and_keeps_polygons_coordinates_and_normals(folder):
    said = bake("m.obj", "-o", "out.obj")
    assert said == ""
    bake("m.obj", "-o", "w.npy")
    before, after = (scenes.load(name, "x.glb") for name in ("m.obj", "out.obj"))
    for name in ("vertices", "faces", "normals"):
        np.testing.assert_array_equal(getattr(before.mesh, name), getattr(after.mesh, name))
    np.testing.assert_array_equal(before.uv, after.uv)
    assert after.sizes.tolist() == [4, 3]
    np.testing.assert_allclose(decode_srgb(after.colours(srgb=True)), np.load("w.npy")[:, None].repeat(3, 1), atol=2e-6)
    foreign = trimesh.load("out.obj", process=False, maintain_order=True)
    assert len(foreign.faces) == 3
    trimesh.creation.box().export("box.ply")
    bake("box.ply", "-o", "box.obj")
    np.testing.assert_array_equal(scenes.load("box.obj").mesh.faces, scenes.load("box.ply").mesh.faces)


def test_a_ply_has_w_by_another_name_too(folder):
    for options in (("--ply-name", "quality"), ("--preset", "meshlab")):
        bake("m.obj", "-o", "q.ply", *options)
        vertex = columns_of(scenes.load("q.ply", "x.ply").raw.elements, "vertex")
        np.testing.assert_array_equal(vertex["quality"].values, vertex["obscurance"].values)
        assert vertex["quality"].kind == "f"
    said = bake("rich.ply", "-o", "q.ply", "--ply-name", "quality")
    assert "w takes the place of quality of rich.ply" in said
    vertex = columns_of(scenes.load("q.ply", "x.ply").raw.elements, "vertex")
    np.testing.assert_array_equal(vertex["quality"].values, vertex["obscurance"].values)


@pytest.mark.parametrize("name", ["x", "nz", "red", "two words", "", "obscurance", "größe\n"])
def test_names_that_cannot_be_are_refused(folder, name):
    done = obscurance("bake", "m.obj", "-o", "q.ply", "--ply-name", name, "--samples", 8)
    if name:
        refused(done, "--ply-name: expected a word other than those of coordinates and colours, such as quality")
    assert (folder / "q.ply").exists() == (not name)


def test_another_output_than_a_ply_is_refused(folder):
    refused(obscurance("bake", "m.obj", "-o", "q.glb", "--ply-name", "quality"), "--ply-name needs a .ply output")
