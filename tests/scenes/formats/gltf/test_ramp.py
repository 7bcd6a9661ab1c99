"""w as a ramp in the occlusion textures of a .glb, read back by a reader of the tests' own."""

import json

import numpy as np
import OpenImageIO as oiio
import pytest
from gltf_files import HALVES, QUAD, Builder, check_glb, values
from gltf_samples import SAMPLES, UV, occluded, quad, transformed, variants
from mesh_files import ply

from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.scenes.asset.primitive import StoredBake
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.unsupported import unsupported_features
from obscurance.scenes.formats.write import channels, write

EXACT = 1 / 512
SEAMS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
SEAMS += "usemtl a\nf 1/1 2/2 3/3 4/4\nusemtl b\nf 2/1 5/2 3/3\n"


def bake(count):
    return StoredBake(np.random.default_rng(count).random(count))


def written(folder, data, name="in.glb", **options):
    """What was baked, its w, and the header and bytes of the output."""
    (folder / name).write_bytes(data)
    source = load(folder / name, folder / "out.glb")
    result = bake(len(source.mesh.vertices))
    write(folder / "out.glb", result, source, **options)
    return source, result.w, *check_glb((folder / "out.glb").read_bytes())


def pixels(folder, header, binary, texture):
    """The codes of a texture's first channel, as OpenImageIO reads them from its PNG."""
    view = header["bufferViews"][header["images"][header["textures"][texture]["source"]]["bufferView"]]
    (folder / "image.png").write_bytes(binary[view["byteOffset"] :][: view["byteLength"]])
    image = oiio.ImageBuf(str(folder / "image.png"))
    assert image.spec().format == oiio.UINT8
    return image.get_pixels(oiio.UINT8)[:, :, 0].astype(float)


def bilinear(codes, uv):
    """A clamped linear filter over texels whose centres lie at half integers, values in [0, 1]."""
    size = np.array(codes.shape[::-1])
    at = np.clip(uv, 0, 1) * size - 0.5
    low = np.floor(at)
    (s, t), (x, y) = (at - low).T, low.astype(int).T
    x0, x1 = (np.clip(x + step, 0, size[0] - 1) for step in (0, 1))
    y0, y1 = (np.clip(y + step, 0, size[1] - 1) for step in (0, 1))
    upper = (1 - s) * codes[y0, x0] + s * codes[y0, x1]
    lower = (1 - s) * codes[y1, x0] + s * codes[y1, x1]
    return ((1 - t) * upper + t * lower) / 255


def drawn(header):
    """The triangle primitives that nodes of the scene draw, node after node."""
    for node in header["scenes"][header.get("scene", 0)]["nodes"]:
        if "mesh" in header["nodes"][node]:
            yield from header["meshes"][header["nodes"][node]["mesh"]]["primitives"]


def occlusion(header, primitive):
    return header["materials"][primitive["material"]].get("occlusionTexture")


def read_back(folder, header, binary):
    """w of each drawn primitive's vertices by its ramp, None without a ramp."""
    for primitive in drawn(header):
        used = occlusion(header, primitive)
        codes = pixels(folder, header, binary, used["index"])
        if codes.shape != (4, 256):
            yield None
            continue
        uv = values(header, binary, primitive["attributes"][f"TEXCOORD_{used.get('texCoord', 0)}"])
        yield bilinear(codes, uv)


@pytest.mark.parametrize("name", SAMPLES)
def test_the_ramp_gives_w_back(tmp_path, name):
    source, w, header, binary = written(tmp_path, SAMPLES[name](), replace_occlusion=True)
    found = list(read_back(tmp_path, header, binary))
    assert len(found) == len(source.parts)
    for part, values_found in zip(source.parts, found, strict=True):
        np.testing.assert_allclose(values_found, w[part.vertices], rtol=0, atol=1e-6)
        assert EXACT > 1e-6
    sampler = header["samplers"][header["textures"][-1]["sampler"]]
    assert sampler == {"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}
    for primitive in drawn(header):
        sets = sorted(int(each[9:]) for each in primitive["attributes"] if each.startswith("TEXCOORD_"))
        assert sets == list(range(len(sets)))
        assert "_OBSCURANCE" in primitive["attributes"]


@pytest.mark.parametrize("name", SAMPLES)
def test_a_second_bake_replaces_the_ramp(tmp_path, name):
    _, _, before, _ = written(tmp_path, SAMPLES[name](), replace_occlusion=True)
    again = (tmp_path / "out.glb").read_bytes()
    source, w, header, binary = written(tmp_path, again)
    for part, found in zip(source.parts, read_back(tmp_path, header, binary), strict=True):
        np.testing.assert_allclose(found, w[part.vertices], rtol=0, atol=1e-6)
    assert [set(each["attributes"]) for each in drawn(header)] == [set(each["attributes"]) for each in drawn(before)]
    assert len(header["materials"]) == len(before["materials"])
    assert not any(
        "keeps" in line
        for line in unsupported_features(tmp_path / "out.glb", source, channels("o.glb", None, None, False))
    )


def test_meshes_of_other_formats_have_it_for_every_material(tmp_path):
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\n")
    _, w, header, binary = written(tmp_path, b"mtllib m.mtl\n" + SEAMS.encode(), "m.obj")
    found = np.concatenate(list(read_back(tmp_path, header, binary)))
    np.testing.assert_allclose(found, w[[0, 1, 2, 3, 1, 2, 4]], rtol=0, atol=1e-6)
    assert [each["occlusionTexture"]["texCoord"] for each in header["materials"][1:]] == [1, 1]
    assert len(header["images"]) == 1
    _, w, header, binary = written(tmp_path, ply(QUAD, HALVES), "m.ply")
    np.testing.assert_allclose(next(read_back(tmp_path, header, binary)), w, rtol=0, atol=1e-6)
    assert header["materials"][0]["occlusionTexture"] == {"index": 0}


def test_every_instance_has_its_own_values(tmp_path):
    source, _, header, _ = written(tmp_path, SAMPLES["instances"]())
    meshes = [node["mesh"] for node in header["nodes"]]
    assert len(set(meshes[:3])) == 3
    assert len({int(n) for each in drawn(header) for n in [each["attributes"]["TEXCOORD_1"]]}) == 3
    assert [each["name"] for each in header["materials"]] == ["paint"]  # what no scene shows is a copy of what is shown
    assert len(source.parts) == 3


def test_a_mesh_that_no_scene_shows_keeps_its_material(tmp_path):
    builder = Builder()
    builder.mesh(quad(builder, 0, material=0))
    builder.mesh(quad(builder, 0, material=0))
    _, _, header, _ = written(tmp_path, builder.glb([{"mesh": 0}, {"mesh": 1}], [0], materials=[{"name": "m"}]))
    assert header["meshes"][1]["primitives"][0]["material"] == 0
    assert header["materials"][0] == {"name": "m"}
    assert header["meshes"][0]["primitives"][0]["material"] == 1


def test_morph_targets_stay(tmp_path):
    _, _, header, binary = written(tmp_path, SAMPLES["morphed"]())
    assert [mesh["weights"] for mesh in header["meshes"]] == [[0.25], [0.25]]
    assert header["nodes"] == [{"mesh": 0}, {"mesh": 1, "weights": [0.5], "translation": [2, 0, 0]}]
    for primitive in drawn(header):
        (target,) = primitive["targets"]
        np.testing.assert_array_equal(values(header, binary, target["POSITION"])[:, 2], 1)


@pytest.mark.parametrize("name", ["sparse", "sparse_without_base"])
def test_sparse_accessors_are_read_and_kept(tmp_path, name):
    source, _, header, _ = written(tmp_path, SAMPLES[name]())
    np.testing.assert_array_equal(source.mesh.vertices, QUAD)
    np.testing.assert_array_equal(load(tmp_path / "out.glb").mesh.vertices, QUAD)
    assert "sparse" in header["accessors"][0]


def test_textures_that_are_moved_stay(tmp_path):
    source, _, header, _ = written(tmp_path, transformed())
    (primitive,) = drawn(header)
    assert occlusion(header, primitive)["texCoord"] == 2
    surface = header["materials"][0]["pbrMetallicRoughness"]
    assert surface == source.raw.header["materials"][0]["pbrMetallicRoughness"]
    (warning,) = unsupported_features(tmp_path / "out.glb", source, channels("out.glb", None, "ramp", False))
    expected = "out.glb: uses the set TEXCOORD_2; not every viewer reads more than 2: remove sets that are not used"
    assert warning.endswith(expected)


def test_variants_of_materials_are_kept_apart(tmp_path):
    _, _, header, _ = written(tmp_path, variants())
    assert [each["name"] for each in header["materials"]] == ["day", "night"]
    assert all(each["occlusionTexture"] == {"index": 0} for each in header["materials"])


def test_an_occlusion_texture_of_the_file_is_kept_and_that_is_reported(tmp_path):
    source, w, header, binary = written(tmp_path, occluded(0.5))
    first, second = drawn(header)
    assert occlusion(header, first) == {"index": 0, "strength": 0.5}
    assert "TEXCOORD_1" not in first["attributes"]
    np.testing.assert_array_equal(values(header, binary, first["attributes"]["_OBSCURANCE"]), w[:4].astype("<f4"))
    assert occlusion(header, second) == {"index": 1, "texCoord": 1}
    (warning,) = unsupported_features(tmp_path / "out.glb", source, channels("out.glb", None, None, False))
    assert "keeps the file's own occlusion textures (primitives: 1 of 2)" in warning
    assert not unsupported_features(tmp_path / "out.glb", source, channels("out.glb", None, None, True))


def test_where_all_are_kept_no_ramp_is_written(tmp_path):
    builder = Builder()
    builder.mesh(quad(builder, 0, material=0))
    materials = [{"occlusionTexture": {"index": 0}}]
    data = builder.glb([{"mesh": 0}], materials=materials, textures=[{"source": 0}], images=[{"uri": "none.png"}])
    _, _, header, _ = written(tmp_path, data)
    assert len(header["images"]) == len(header["textures"]) == 1
    assert "samplers" not in header


def test_plain_data_beside_compressed_are_read_and_those_alone_are_written(tmp_path):
    builder = Builder()
    draco = {"bufferView": 0, "attributes": {"POSITION": 0}}
    builder.mesh(quad(builder, extensions={"KHR_draco_mesh_compression": draco}))
    used = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_materials_unlit"]
    builder.header["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {"buffer": 0}}
    _, w, header, binary = written(tmp_path, builder.glb([{"mesh": 0}], extensionsUsed=used))
    np.testing.assert_allclose(next(read_back(tmp_path, header, binary)), w, rtol=0, atol=1e-6)
    assert header["extensionsUsed"] == ["KHR_materials_unlit"]
    assert "extensions" not in header["bufferViews"][0]
    assert "extensions" not in next(drawn(header))


def test_a_ply_takes_no_ramp_for_texture_coordinates(tmp_path):
    written(tmp_path, SAMPLES["plain"]())
    source = load(tmp_path / "out.glb", tmp_path / "m.ply")
    assert source.uv is None
    written(tmp_path, SAMPLES["textured"]())
    source = load(tmp_path / "out.glb", tmp_path / "m.ply")
    np.testing.assert_array_equal(source.uv, np.stack([UV[:, 0], 1 - UV[:, 1]], axis=1)[source.mesh.faces])
    assert "TEXCOORD_1" not in source.unread


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"materials": [{"occlusionTexture": 3}]}, "materials[0].occlusionTexture: expected an object"),
        ({"materials": [{"occlusionTexture": {"index": -1}}]}, "materials[0].occlusionTexture.index: expected"),
        ({"materials": 3}, "materials: expected a list"),
        ({"textures": [{"source": "x"}]}, "textures[0].source: expected"),
    ],
)
def test_malformed_materials_are_refused_before_the_bake(tmp_path, change, field):
    builder = Builder()
    builder.mesh(quad(builder, material=0))
    (tmp_path / "in.glb").write_bytes(builder.glb([{"mesh": 0}], **change))
    with pytest.raises(MeshError) as error:
        load(tmp_path / "in.glb", tmp_path / "out.glb")
    assert field in str(error.value)
    load(tmp_path / "in.glb", tmp_path / "out.npy")


def test_references_to_nothing_are_left_alone(tmp_path):
    builder = Builder()
    builder.mesh(quad(builder, material=7), quad(builder, material=0))
    header = written(tmp_path, builder.glb([{"mesh": 0}], materials=[{"occlusionTexture": {"index": 9}}]))[2]
    first, second = drawn(header)
    assert (first["material"], second["material"]) == (7, 0)
    assert header["materials"] == [{"occlusionTexture": {"index": 9}}]


@pytest.mark.parametrize(
    ("target", "options", "expected"),
    [
        ("m.ply", {"occlusion": "ramp"}, "occlusion='ramp' needs a .glb output"),
        ("m.glb", {"occlusion": "pramp"}, "occlusion: expected one of none, ramp, got pramp"),
    ],
)
def test_options_that_exclude_each_other(tmp_path, monkeypatch, target, options, expected):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.glb").write_bytes(SAMPLES["plain"]())
    with pytest.raises(OptionError) as error:
        write(target, bake(4), load("in.glb"), **options)
    assert expected in str(error.value)
    assert not (tmp_path / target).exists()


def test_colours_come_without_a_ramp_and_neither_if_none_is_asked_for(tmp_path):
    for options in ({"colors": "rgb"}, {"occlusion": "none"}):
        _, _, header, _ = written(tmp_path, SAMPLES["plain"](), **options)
        assert "images" not in header
        assert "occlusionTexture" not in json.dumps(header)
