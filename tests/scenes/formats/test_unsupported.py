"""Contents of glTF, STL, OFF and 3MF files come through a bake: outputs keep what they can, and report the rest."""

import numpy as np
import pytest
from fuzz_seeds import MODEL, archive
from gltf_files import HALVES, QUAD, Builder, check_glb, values
from kept_contents import bake, columns
from mesh_files import ascii_stl, read, stl

from obscurance.raytrace.image.colour import encode_srgb
from obscurance.scenes.formats.unsupported import unsupported_features


def test_a_ply_keeps_colours_and_texture_coordinates_of_a_gltf(tmp_path):
    builder = Builder()
    primitive = builder.primitive(QUAD, HALVES)
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
    (tmp_path / "m.stl").write_bytes(stl(QUAD[HALVES]))
    for target in ("w.npy", "w.npz", "w.ply", "w.glb"):
        assert bake(tmp_path, "m.stl", target) == ""


def test_polygons_that_cross_themselves_are_reported(tmp_path):
    (tmp_path / "bow.obj").write_text("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n")
    assert "bow.obj: 1 polygon crosses itself" in bake(tmp_path, "bow.obj", "w.npy")


@pytest.mark.parametrize("name", ["m.off", "m.ply"])
def test_faces_of_two_corners_are_reported_and_kept(tmp_path, name):
    rows = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n2 1 2\n"
    head = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    head += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / name).write_text((head if name == "m.ply" else "OFF\n3 2 0\n") + rows)
    assert "1 faces of fewer than three corners are no triangles" in bake(tmp_path, name, "w.obj")
    assert read(tmp_path, "w.obj", (tmp_path / "w.obj").read_bytes()).sizes.tolist() == [3, 2]


def test_lines_of_a_gltf_are_reported_where_they_are_lost(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, HALVES), builder.primitive(QUAD, mode=2))
    (tmp_path / "m.glb").write_bytes(builder.glb([{"mesh": 0}]))
    assert "w.ply: not kept from m.glb: points and lines" in bake(tmp_path, "m.glb", "w.ply").replace(
        f"{tmp_path}/", ""
    )
    assert "lines" not in bake(tmp_path, "m.glb", "w.glb")


def test_colours_of_an_off_file_are_reported(tmp_path):
    file = read(tmp_path, "m.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n")
    assert "colours" in unsupported_features(tmp_path / "w.ply", file)[0]


@pytest.mark.parametrize("objects", [1, 2])
def test_objects_of_an_stl_file_are_reported(tmp_path, objects):
    solids = [(name, QUAD[HALVES]) for name in "ab"[:objects]]
    found = unsupported_features(tmp_path / "w.ply", read(tmp_path, "m.stl", ascii_stl(*solids)))
    assert ("its division into objects" in " ".join(found)) == (objects > 1)


@pytest.mark.parametrize("tag", [b"texture2dgroup", b"multiproperties"])
def test_materials_of_a_3mf_file_are_reported(tmp_path, tag):
    model = MODEL.replace(b"<resources>", b'<resources><%s id="7"/>' % tag)
    file = read(tmp_path, "m.3mf", archive(**{"3D/3dmodel.model": model}))
    for target in ("w.ply", "w.glb"):
        assert "colours of textures or mixtures" in unsupported_features(tmp_path / target, file)[0]


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
