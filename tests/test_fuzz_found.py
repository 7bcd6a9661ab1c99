"""One small case for each fault that fuzzing or its preparation found; see docs/reliability.md."""

import json
import struct
import sys
import time
import zlib
from types import SimpleNamespace

import fuzz_seeds
import numpy as np
import OpenImageIO as oiio
import pytest
from fuzz_mutations import toml_text
from fuzz_worker import memory, reset_peak
from gltf_files import TRIANGLE, Builder
from mesh_files import FACES, VERTICES, ascii_ply, ascii_stl, mistake, obj, ply, read

import scenes.flatten
import scenes.threemf
from raytrace.errors import InputError, MeshError, OptionError, SceneError
from raytrace.image_input import read_image
from raytrace.mesh import Mesh
from raytrace.placement import Placement
from raytrace.texture import Texture, pack_textures
from scenes.info import describe
from scenes.load import MeshFile, load
from scenes.obscured import obscured
from scenes.polygons import fan_triangles
from scenes.read import read_scene
from scenes.write import write

PLANE = {"objects": [{"builtin": "plane", "fineness": 1.0}]}


def scene_mistake(tmp_path, text, name="m.toml"):
    """The message of the error that reading this scene must give."""
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as error:
        read_scene(tmp_path / name, (8, 6))
    message = str(error.value)
    assert message.isprintable()
    assert message.startswith(str(tmp_path))
    return message


def triangle():
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE))
    return builder


def baked(count):
    """A bake of that many vertices."""
    return SimpleNamespace(
        w=np.ones(count), error=np.zeros(count), bent_normals=np.zeros((count, 3)), flags=np.zeros(count, np.uint8)
    )


def model(**replaced):
    content = fuzz_seeds.MODEL
    for old, new in replaced.values():
        assert old in content
        content = content.replace(old, new)
    return fuzz_seeds.archive(**{"3D/3dmodel.model": content})


def test_messages_are_printable_and_short(tmp_path):
    message = scene_mistake(tmp_path, 'background = "\\u001b[31m"\n' + toml_text(PLANE))
    assert r"\x1b[31m" in message
    long = InputError("m.ply", "f" * 5000, "e", "g\n" * 5000)
    assert len(str(long)) < 700
    assert str(long).isprintable()
    assert (long.field, long.got) == ("f" * 5000, "g\n" * 5000)


@pytest.mark.skipif(sys.platform != "linux", reason="/proc tells")
@pytest.mark.xfail(strict=False, reason="pairs of points and faces in contact are listed, however many there are")
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
        rows = dict(describe(MeshFile.of(Mesh(VERTICES * size, FACES))))
        assert float(rows["radius"].split(",")[0]) == pytest.approx(7.79423 * size, rel=1e-5)
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
    ("old", "new", "expected"),
    [
        (b"property double y", b"property double x", "property x twice"),
        (b"element face", b"element vertex", "element vertex twice"),
        (b"vertex 7", b"vertex -7", "negative count"),
        (b"3 0 1 3", b"2.5 0 1 3", "a list of 2.5 values"),
        (b"3 0 1 3", b"3 0 1 2.5", "no whole numbers"),
        (b"3 0 1 3\n", b"3 0 1 3 4\n", "one line for each, with as many numbers"),
        (b"1.0 0.0 0.0\n1.0 0.0 0.0\n", b"1.0 0.0 0.0 1.0 0.0 0.0\n", "one line for each"),
        (b"3 2 5 3\n", b"3 2 5 3\n7\n", "one line for each, with as many numbers"),
        (b"property list uchar int", b"property list", "KeyError: 'list'"),
        (b"property list uchar int vertex_indices", b"property list", "the line property list"),
    ],
)
def test_ply_that_contradicts_itself(tmp_path, old, new, expected):
    assert expected in mistake(tmp_path, "m.ply", ascii_ply().replace(old, new))


def test_a_ply_comment_may_say_end_header(tmp_path):
    data = ply().replace(b"element vertex", b"comment end_header\nelement vertex")
    assert len(read(tmp_path, "m.ply", data).mesh.faces) == len(FACES)


def test_an_obj_index_of_very_many_digits_is_no_burden(tmp_path):
    text = obj() + b"vn 0 0 1\nf 1/1/1 2/1/1 3/1/" + b"1" * 200_000 + b"\n"
    start = time.process_time()
    mistake(tmp_path, "m.obj", text.replace(b"f 1 2 4\n", b"").replace(b"f 1 4 5\n", b"").replace(b"f 3 6 4\n", b""))
    assert time.process_time() - start < 2


def test_stl_with_very_many_solids_of_one_name(tmp_path):
    data = ascii_stl(*[("a", VERTICES[FACES[:1]])] * 10_000)
    start = time.process_time()
    assert len(read(tmp_path, "m.stl", data).parts) == 10_000
    assert time.process_time() - start < 5


def test_one_gltf_array_is_not_placed_without_end(tmp_path, monkeypatch):
    monkeypatch.setattr(scenes.flatten, "MAX_COPIED", 1000)
    assert len(read(tmp_path, "m.glb", triangle().glb([{"mesh": 0}] * 250)).parts) == 250
    message = mistake(tmp_path, "m.glb", triangle().glb([{"mesh": 0}] * 251))
    assert "objects: expected at most 1,000 vertices and triangles with all copies, got 1,004" in message


def test_a_large_gltf_is_no_copy(tmp_path, monkeypatch):
    monkeypatch.setattr(scenes.flatten, "MAX_COPIED", 1)
    assert len(read(tmp_path, "m.glb", triangle().glb([{"mesh": 0}])).mesh.faces) == 1


@pytest.mark.parametrize("stride", [4, 8])
def test_overlapping_gltf_rows_are_refused(tmp_path, stride):
    builder = triangle()
    builder.header["bufferViews"][0]["byteStride"] = stride
    assert "does not fit" in mistake(tmp_path, "m.glb", builder.glb([{"mesh": 0}]))


def test_gltf_buffers_of_one_file_are_read_once(tmp_path, monkeypatch):
    from pathlib import Path

    calls = []
    original = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: calls.append(path.name) or original(path))
    builder = triangle()
    (tmp_path / "m.bin").write_bytes(builder.binary)
    names = ["m.bin", "./m.bin", "x/../m.bin"] * 5
    header = builder.header | {"buffers": [{"uri": name, "byteLength": len(builder.binary)} for name in names]}
    header |= {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    (tmp_path / "m.gltf").write_text(json.dumps(header))
    (tmp_path / "x").mkdir()
    load(tmp_path / "m.gltf")
    assert calls.count("m.bin") == 1


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda h: h["nodes"][0].update(mesh="0"), 'nodes[0].mesh: expected a whole number, got "0"'),
        (lambda h: h["nodes"][0].update(mesh=-1), "nodes[0].mesh: expected greater than or equal to 0"),
        (lambda h: h["nodes"][0].update(matrix=[0, 1]), "nodes[0].matrix: expected"),
        (lambda h: h["bufferViews"][0].update(byteOffset=-4), "bufferViews[0].byteOffset"),
        (lambda h: h["bufferViews"][0].update(buffer=9), "there is no buffers[9]"),
        (lambda h: h["accessors"][0].update(bufferView=9), "there is no bufferViews[9]"),
        (lambda h: h["accessors"][0].update(type="MAT4"), "accessors[0]: expected VEC3"),
        (lambda h: h["accessors"][0].update(count=1e300), "accessors[0].count: expected a whole number"),
        (lambda h: h.update(scene=9), "there is no scenes[9]"),
        (lambda h: h.update(nodes=[1] * 1000), "nodes[0]: expected an object, got 1"),
        (lambda h: h.update(materials=[{"emissiveFactor": "x"}]), "materials[0].emissiveFactor: expected"),
        (lambda h: h.update(cameras=[{"type": "x" * 5000}]), "cameras[0]: expected one of 'perspective'"),
        (
            lambda h: h.update(materials=[{"pbrMetallicRoughness": {"baseColorFactor": [1, 1]}}]),
            "materials[0].pbrMetallicRoughness.baseColorFactor[2]: expected a value, got nothing",
        ),
    ],
)
def test_gltf_faults_have_a_path(tmp_path, change, expected):
    builder = triangle()
    builder.header |= {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    change(builder.header)
    content = builder.glb(builder.header["nodes"], **{"scenes": builder.header["scenes"]})
    assert expected in scene_mistake(tmp_path, content, "m.glb")


def test_gltf_names_that_are_no_text(tmp_path):
    """JSON can write half a character; a GLB file keeps it."""
    file = read(tmp_path, "m.glb", triangle().glb([{"mesh": 0, "name": "\ud800"}]))
    write(tmp_path / "w.glb", baked(3), file)
    assert [part.name for part in load(tmp_path / "w.glb").parts] == ["\ud800"]
    assert ("objects", r"1: \ud800") in describe(file)


def test_a_material_that_is_refused_is_named(tmp_path):
    builder = triangle()
    builder.header["meshes"][0]["primitives"][0]["material"] = 0
    materials = [{"emissiveFactor": [-1, 0, 0]}]
    message = scene_mistake(tmp_path, builder.glb([{"mesh": 0}], materials=materials), "m.glb")
    assert "m.glb: materials[0].emission[0]: expected a number in [0, inf), got -1" in message


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (b'<component objectid="1"/>', b'<component objectid="2"/>', "components other than itself, got a cycle"),
        (b'<component objectid="1"/>', b'<component objectid="7"/>', "object 7: expected an object of the file"),
        (b"1 0 0 0 1 0 0 0 1 5 0 0", b"1 0 0", "3MF file"),
        (b"</triangles>", b'<triangle v1="0"/></triangles>', "KeyError: 'v2'"),
        (b'v1="0" v2="2"', b'v1="9" v2="2"', "indices from 0 to 3"),
        (b'x="1"', b'x="nan"', "finite coordinates"),
    ],
)
def test_3mf_mistakes(tmp_path, old, new, expected):
    assert expected in mistake(tmp_path, "m.3mf", model(a=(old, new)))


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


def test_archives_that_unpack_to_very_much(tmp_path, monkeypatch):
    monkeypatch.setattr(scenes.threemf, "SPARE", 1000)
    data = fuzz_seeds.archive(**{"3D/3dmodel.model": fuzz_seeds.MODEL + b" " * 1_000_000})
    for name in ("m.3mf", "m.3dxml"):
        assert "an archive that unpacks to at most" in mistake(tmp_path, name, data)


def test_xml_entities_reach_no_file(tmp_path):
    declared = (b"?>", b"?><!DOCTYPE a [<!ENTITY e SYSTEM 'file:///etc/passwd'>]>")
    assert "3MF file" in mistake(tmp_path, "m.3mf", model(a=declared, b=(b'name="one"', b'name="&e;"')))
    file = read(tmp_path, "m.3mf", model(a=declared, b=(b"</build>", b"&e;</build>")))
    assert {part.name for part in file.parts} == {"one"}


def test_toml_keys_of_very_many_parts(tmp_path):
    start = time.process_time()
    for key in ("a.", '"a b" . ', "'.'."):
        text = "objects." + key * 20_000 + "b = 1\n"
        assert "keys of fewer than 100 parts" in scene_mistake(tmp_path, text)
    assert time.process_time() - start < 2
    numbers = "background = [" + "0.5," * 500 + "]\n" + toml_text(PLANE)
    assert "background: expected" in scene_mistake(tmp_path, numbers)


def test_copies_in_a_toml_scene_end_somewhere(tmp_path, monkeypatch):
    monkeypatch.setattr(scenes.flatten, "MAX_COPIED", 1000)
    (tmp_path / "m.obj").write_bytes(obj())
    copied = {"mesh": "m.obj", "copies": [{}] * 101}
    assert "m.toml: objects: expected at most 1,000" in scene_mistake(tmp_path, toml_text({"objects": [copied]}))
    several = {"objects": [{"builtin": "plane", "fineness": 0.1, "size": [1 + n, 1.0]} for n in range(4)]}
    assert "m.toml: objects: expected at most 1,000" in scene_mistake(tmp_path, toml_text(several))


@pytest.mark.parametrize("ending", ["npy", "npz"])
@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (b"(4,), }" + b" " * 9, b"(9999999999,), }", "w: expected shape"),
        (b"<f4'", b"|O8'", "w: expected numbers, got object"),
        (b"(4,), }", b"(4,), (", "content: expected w as obscurance bake writes it"),
        (b"(4,), }", b"(4L,),}", None),
        (b"\x93NUMPY", b"", "content: expected w as obscurance bake writes it"),
    ],
)
def test_baked_files_are_not_trusted(tmp_path, ending, old, new, expected):
    """Headers of huge, broken and old arrays."""
    content = fuzz_seeds.arrays()[0]
    assert old in content
    content = content.replace(old, new)
    (tmp_path / f"w.{ending}").write_bytes(content if ending == "npy" else fuzz_seeds.archive(**{"w.npy": content}))
    (tmp_path / "m.toml").write_text(toml_text(PLANE | {"obscurance": {"baked": f"w.{ending}"}}))
    description = read_scene(tmp_path / "m.toml")
    if expected is None:
        obscured(description)
        return
    with pytest.raises(SceneError, match=rf"w\.{ending}: {expected}"):
        obscured(description)


def png(width, height, rows=b""):
    """A PNG that claims a size."""
    body = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    made = b"\x89PNG\r\n\x1a\n"
    for kind, content in ((b"IHDR", body), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")):
        made += struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
    return made


def test_images_that_claim_more_than_they_can_hold(tmp_path):
    (tmp_path / "m.png").write_bytes(png(16000, 16000))
    with pytest.raises(InputError, match="size: expected pixels that 65 bytes can hold, got 16000×16000 of 3 channels"):
        read_image(tmp_path / "m.png")
    flat = oiio.ImageOutput.create("png")
    assert flat.open(str(tmp_path / "flat.png"), oiio.ImageSpec(6000, 6000, 3, "uint8"))
    flat.write_image(np.zeros((6000, 6000, 3), np.uint8))
    flat.close()
    assert read_image(tmp_path / "flat.png")[0]["beauty"].shape == (6000, 6000, 3)


def test_an_exr_whose_message_is_no_text(tmp_path):
    content = bytearray(fuzz_seeds.image("openexr", 20, 30, 4, "half"))
    content[content.index(b"channels\0chlist\0")] = 0x80
    (tmp_path / "m.exr").write_bytes(bytes(content))
    with pytest.raises(InputError, match="content: expected an image") as error:
        read_image(tmp_path / "m.exr")
    assert str(error.value).isprintable()


def test_an_image_without_pixels(tmp_path):
    (tmp_path / "m.ppm").write_bytes(b"P6\n7 0\n255\n")
    with pytest.raises(InputError, match=r"m\.ppm: "):
        read_image(tmp_path / "m.ppm")
    content = bytearray(fuzz_seeds.image("targa"))
    content[14:16] = bytes(2)
    (tmp_path / "m.tga").write_bytes(content)
    with pytest.raises(InputError, match=r"m\.tga: "):
        pack_textures([Texture(tmp_path / "m.tga")])


def test_writing_what_float32_cannot_hold(tmp_path):
    normals = np.tile([0.0, 1e300, -1e300], (len(VERTICES), 1))
    normals[0] = np.inf
    file = MeshFile.of(Mesh(VERTICES * 1e50, FACES, normals))
    write(tmp_path / "m.ply", baked(len(VERTICES)), file)
    again = load(tmp_path / "m.ply").mesh
    np.testing.assert_array_equal(again.vertices, VERTICES * 1e50)
    np.testing.assert_allclose(again.normals[1], [0, 1, -1])
    with pytest.raises(OptionError, match=r"coordinates up to 1e\+38 in a \.glb, got 9e\+50"):
        write(tmp_path / "m.glb", baked(len(VERTICES)), file)


def test_polygons_of_very_many_corners(tmp_path):
    corners = 100_000
    angle = 2 * np.pi * np.arange(corners) / corners
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    for name, made in (("m.obj", obj), ("m.ply", ascii_ply)):
        assert len(read(tmp_path, name, made(circle, [range(corners)])).mesh.faces) == corners - 2


def test_missing_corners_are_not_passed_over(tmp_path):
    with pytest.raises(ValueError, match="5 corners for polygons of 6"):
        fan_triangles(np.arange(5), np.array([3, 3]))
    for bad in (b"f x 2 3", b"f 1 2 3x", b"f 1 2 \xc2\xa0"):
        with pytest.raises(MeshError):
            read(tmp_path, "m.obj", obj() + bad + b"\nf 1 2 3\n")
