"""One small case for each fault in mesh files that fuzzing or its preparation found; see evidence/reliability.md."""

import sys
import time

import fuzz_seeds
import numpy as np
import pytest
from command import obscurance
from found_faults import baked, triangle
from fuzz_worker import memory, reset_peak
from mesh_files import FACES, VERTICES, ascii_ply, ascii_stl, mistake, obj, ply, read

from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.placement import Placement
from obscurance.scenes.asset.asset import Asset
from obscurance.scenes.commands.info import describe
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.write import write
from obscurance.scenes.geometry.polygons import triangulate


def model(**replaced):
    content = fuzz_seeds.MODEL
    for old, new in replaced.values():
        assert old in content
        content = content.replace(old, new)
    return fuzz_seeds.archive(**{"3D/3dmodel.model": content})


@pytest.mark.skipif(sys.platform != "linux", reason="measures by /proc")
def test_unused_vertices_on_coinciding_faces_take_no_memory_by_the_square(tmp_path):
    path = tmp_path / "m.obj"
    path.write_bytes(300 * obj())  # all faces use the first few vertices
    describe(read(tmp_path, "small.obj", obj()))
    before = memory()
    reset_peak()
    describe(load(path))
    assert memory("VmHWM") - before < 256 * path.stat().st_size + (64 << 20)


def test_info_prints_no_control_characters(tmp_path):
    file = read(tmp_path, "m.glb", triangle().glb([{"mesh": 0, "name": "a\x1b[31m\0b\nc"}]))
    assert ("objects", r"1: a\x1b[31m\x00b\nc") in describe(file)


def test_coordinates_that_overflow_or_vanish(tmp_path):
    assert "finite coordinates up to 5e+153" in mistake(tmp_path, "m.ply", ascii_ply(VERTICES * 1e200))
    for size in (1e-200, 1e-9, 1e152):
        rows = dict(describe(Asset.of(Mesh(VERTICES * size, FACES))))
        assert float(rows["radius"].split(",")[0]) == pytest.approx(1.125 * size, rel=1e-5)
        assert float(rows["area"]) == pytest.approx(1.53033 * size**2, rel=1e-5)
    assert np.isfinite(Placement.of(Mesh(VERTICES * 1e-310, FACES)).vertices).all()


def test_a_text_ply_of_many_properties_and_rows_takes_little(tmp_path):
    """A reader of one array a value takes memory by the square of the file's size."""
    names = "".join(f"property char p{number}\n" for number in range(3000))
    data = f"ply\nformat ascii 1.0\nelement vertex 25000\n{names}end_header\n" + "0\n" * 25000
    start = time.process_time()
    assert "element vertex: expected 25000 rows" in mistake(tmp_path, "m.ply", data.encode())
    assert time.process_time() - start < 2


@pytest.mark.parametrize(
    ("kind", "old", "new", "expected"),
    [
        ("ply", b"property double y", b"property double x", "property x twice"),
        ("ply", b"element face", b"element vertex", "element vertex twice"),
        ("ply", b"vertex 7", b"vertex -7", "negative count"),
        ("ply", b"3 0 1 3", b"2.5 0 1 3", "a list of 2.5 values"),
        ("ply", b"3 0 1 3", b"3 0 1 2.5", "no whole numbers"),
        ("ply", b"3 0 1 3\n", b"3 0 1 3 4\n", "one line for each, with as many numbers"),
        ("ply", b"1.0 0.0 0.0\n1.0 0.0 0.0\n", b"1.0 0.0 0.0 1.0 0.0 0.0\n", "expected 3 numbers, got 6"),
        ("ply", b"3 2 5 3\n", b"3 2 5 3\n7\n", "one line for each, with as many numbers"),
        ("ply", b"property list uchar int", b"property list", "no 'list'"),
        ("ply", b"property list uchar int vertex_indices", b"property list", "the line property list"),
        (
            "3mf",
            b'<component objectid="1"/>',
            b'<component objectid="2"/>',
            "components other than itself, got a cy",
        ),
        ("3mf", b'<component objectid="1"/>', b'<component objectid="7"/>', "object 7: expected an object of the file"),
        ("3mf", b"1 0 0 0 1 0 0 0 1 5 0 0", b"1 0 0", "3MF file"),
        ("3mf", b"</triangles>", b'<triangle v1="0"/></triangles>', "no 'v2'"),
        ("3mf", b'v1="0" v2="2"', b'v1="9" v2="2"', "indices from 0 to 3"),
        ("3mf", b'x="1"', b'x="nan"', "finite coordinates"),
    ],
)
def test_a_file_that_contradicts_itself(tmp_path, kind, old, new, expected):
    """A PLY or 3MF file with a part replaced."""
    data = ascii_ply().replace(old, new) if kind == "ply" else model(a=(old, new))
    assert expected in mistake(tmp_path, f"m.{kind}", data)


def test_a_ply_comment_may_say_end_header(tmp_path):
    data = ply().replace(b"element vertex", b"comment end_header\nelement vertex")
    assert len(read(tmp_path, "m.ply", data).mesh.faces) == len(FACES)


def test_an_obj_index_of_very_many_digits_is_no_burden(tmp_path):
    text = obj() + b"vn 0 0 1\nf 1/1/1 2/1/1 3/1/" + b"1" * 200_000 + b"\n"
    start = time.process_time()
    read(tmp_path, "m.obj", text)
    assert time.process_time() - start < 2


def test_stl_with_very_many_solids_of_one_name(tmp_path):
    data = ascii_stl(*[("a", VERTICES[FACES[:1]])] * 10_000)
    start = time.process_time()
    assert len(read(tmp_path, "m.stl", data).parts) == 10_000
    assert time.process_time() - start < 5


@pytest.mark.parametrize(
    ("triangles", "expected"), [(b"<triangle ", "vertices and triangles with all"), (b"<nothing ", "objects with all")]
)
def test_3mf_components_that_double(tmp_path, triangles, expected):
    """57 objects of two components each stand for 2^57 copies, be it of nothing."""
    chain = b"".join(
        b'<object id="%d"><components><component objectid="%d"/><component objectid="%d"/></components></object>'
        % (number, number - 1, number - 1)
        for number in range(3, 60)
    )
    data = model(
        a=(b"</resources>", chain + b"</resources>"),
        b=(b'item objectid="2"', b'item objectid="59"'),
        c=(b"<triangle ", triangles),
        d=(b"<vertex ", triangles.replace(b"triangle", b"vertex")),
    )
    assert expected in mistake(tmp_path, "m.3mf", data)


def test_archives_that_unpack_to_very_much(tmp_path):
    data = fuzz_seeds.archive(**{"3D/3dmodel.model": fuzz_seeds.MODEL + b" " * 24_000_000})
    for name in ("m.3mf", "m.zae"):
        assert "an archive that unpacks to at most" in mistake(tmp_path, name, data)


def test_xml_entities_reach_no_file(tmp_path):
    declared = (b"?>", b"?><!DOCTYPE a [<!ENTITY e SYSTEM 'file:///etc/passwd'>]>")
    assert "3MF file" in mistake(tmp_path, "m.3mf", model(a=declared, b=(b'name="one"', b'name="&e;"')))
    file = read(tmp_path, "m.3mf", model(a=declared, b=(b"</build>", b"&e;</build>")))
    assert {part.name for part in file.parts} == {"one"}


def test_writing_what_float32_cannot_hold(tmp_path):
    normals = np.tile([0.0, 1e300, -1e300], (len(VERTICES), 1))
    normals[0] = np.inf
    file = Asset.of(Mesh(VERTICES * 1e50, FACES, normals))
    write(tmp_path / "m.ply", baked(len(VERTICES)), file)
    again = load(tmp_path / "m.ply").mesh
    np.testing.assert_array_equal(again.vertices, VERTICES * 1e50)
    np.testing.assert_allclose(again.normals[1], [0, 1, -1])
    with pytest.raises(OptionError, match=r"coordinates up to 1e\+38 in a \.glb, got 9e\+50"):
        write(tmp_path / "m.glb", baked(len(VERTICES)), file)


def test_what_float32_cannot_hold_is_refused_in_one_line_before_the_bake(tmp_path):
    colours = [f"{x * 1e50} {y * 1e50} {z * 1e50} 255 0 0" for x, y, z in VERTICES]
    rows = [f"3 {i} {j} {k}" for i, j, k in FACES]
    (tmp_path / "m.off").write_text("\n".join(["COFF", f"{len(VERTICES)} {len(FACES)} 0", *colours, *rows]))
    result = obscurance("bake", tmp_path / "m.off", "-o", tmp_path / "m.glb")
    assert result.returncode == 2
    assert result.stderr.startswith("obscurance: bake --output: expected coordinates up to 1e+38 in a .glb, got 9e+50")
    assert result.stderr.count("\n") == 1


def test_polygons_of_very_many_corners(tmp_path):
    corners = 100_000
    angle = 2 * np.pi * np.arange(corners) / corners
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    for name, made in (("m.obj", obj), ("m.ply", ascii_ply)):
        assert len(read(tmp_path, name, made(circle, [range(corners)])).mesh.faces) == corners - 2


def test_missing_corners_are_not_passed_over(tmp_path):
    with pytest.raises(ValueError, match="5 corners for polygons of 6"):
        triangulate(VERTICES, np.arange(5), np.array([3, 3]))
    for bad in (b"f x 2 3", b"f 1 2 3x", b"f 1 2 \xc2\xa0"):
        with pytest.raises(MeshError):
            read(tmp_path, "m.obj", obj() + bad + b"\nf 1 2 3\n")
