"""w in R of metallic-roughness images: what else they hold is kept, and what cannot hold w stays as it was."""

import io
from types import SimpleNamespace

import numpy as np
import PIL.Image
import pytest
from gltf_files import Builder
from gltf_samples import quad, with_images

from obscurance.raytrace import MeshError
from obscurance.raytrace.image.texture import texture_codes
from obscurance.scenes.formats.gltf.asset import decode
from obscurance.scenes.formats.gltf.orm import with_occlusion
from obscurance.scenes.formats.gltf.textured import textured_glb
from obscurance.scenes.formats.gltf.textures import Textures
from obscurance.scenes.formats.load import load

RNG = np.random.default_rng(0)
W = RNG.random((8, 8)).astype(np.float32)
FIELD = "metallicRoughnessTexture"


def png(codes, kind="PNG"):
    file = io.BytesIO()
    PIL.Image.fromarray(codes).save(file, kind)
    return file.getvalue()


def rough(reference, **fields):
    return {"pbrMetallicRoughness": {FIELD: reference, "roughnessFactor": 0.5}, **fields}


def source(tmp_path, image, material, sets=(0,), **fields):
    """A quad with one image; `fields` replace what the file has at its top."""
    builder = Builder()
    builder.mesh(quad(builder, *sets, material=0))
    content = builder.glb([{"mesh": 0}], materials=[material], **with_images(builder, image) | fields)
    (tmp_path / "in.glb").write_bytes(content)
    return load(tmp_path / "in.glb", "out.glb")


def packed(tmp_path, file, uv=0, w=W, replace=False, said=()):
    uv = file.texture_coordinates(uv) if isinstance(uv, int) else uv
    content, warnings = textured_glb(file, [SimpleNamespace(w=w, uv=uv)], replace, orm=True)
    assert [line.split(",")[0] for line in warnings] == list(said)
    (tmp_path / "out.glb").write_bytes(content)
    return decode(content, tmp_path / "out.glb")


def codes_of(asset, reference):
    return texture_codes(Textures(asset).image(asset.header["textures"][reference["index"]]["source"]))


def both(asset, number=0):
    material = asset.header["materials"][number]
    return material["occlusionTexture"], material["pbrMetallicRoughness"][FIELD]


@pytest.mark.parametrize("channels", [3, 4])
def test_roughness_and_metalness_keep_every_bit_and_w_is_in_red(tmp_path, channels):
    image = RNG.integers(0, 256, (8, 8, channels), np.uint8)
    asset = packed(tmp_path, source(tmp_path, png(image), rough({"index": 0})))
    occlusion, surface = both(asset)
    assert occlusion == surface == {"index": 1}
    found = codes_of(asset, occlusion)
    assert np.array_equal(found[:, :, 1:], image[:, :, 1:])
    assert np.array_equal(found[:, :, 0], np.rint(W * 255))
    assert asset.header["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] == 0.5
    assert np.array_equal(codes_of(asset, {"index": 0}), image)  # the old one, which others may use


def test_sixteen_bits_stay_sixteen_and_grey_becomes_both(tmp_path):
    grey = RNG.integers(0, 65536, (8, 8), np.uint16)
    found = codes_of(asset := packed(tmp_path, source(tmp_path, png(grey), rough({"index": 0}))), both(asset)[0])
    assert found.dtype == np.uint16
    assert np.array_equal(found[:, :, 1], grey)
    assert np.array_equal(found[:, :, 2], grey)
    assert np.array_equal(found[:, :, 0], np.rint(W * np.float32(65535)))


def test_materials_without_an_image_get_a_white_one_and_keep_their_factors(tmp_path):
    material = {"pbrMetallicRoughness": {"roughnessFactor": 0.25, "metallicFactor": 0}}
    asset = packed(tmp_path, source(tmp_path, png(np.zeros((2, 2, 3), np.uint8)), material))
    occlusion, surface = both(asset)
    assert occlusion == surface
    found = codes_of(asset, surface)
    assert (found[:, :, 1:] == 255).all()
    assert np.array_equal(found[:, :, 0], np.rint(W * 255))
    factors = {name: value for name, value in asset.header["materials"][0]["pbrMetallicRoughness"].items()
               if name != FIELD}  # fmt: skip
    assert factors == material["pbrMetallicRoughness"]


def test_so_do_new_coordinates_of_a_mesh_that_was_no_gltf(tmp_path):
    (tmp_path / "in.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    asset = packed(tmp_path, load(tmp_path / "in.obj", "out.glb"), np.array([[[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]]]))
    assert both(asset)[0] == both(asset)[1]


def test_the_smaller_of_two_sizes_is_interpolated():
    ramp = np.tile(np.arange(0, 256, 16, dtype=np.uint8)[:, None], (1, 2))
    image = np.stack([ramp, ramp, ramp], axis=2)  # 2 wide, 16 high
    made = with_occlusion(image, np.float32([[0, 0, 1, 1]]))
    assert made.shape == (16, 4, 3)
    assert np.array_equal(made[:, :, 1], np.tile(ramp[:, :1], (1, 4)))
    assert np.array_equal(made[:, :, 0], np.tile(np.uint8([0, 0, 255, 255]), (16, 1)))
    twice = with_occlusion(np.zeros((1, 8, 3), np.uint8), np.float32([[0, 0, 1, 1]]))[0, :, 0]
    assert twice.tolist() == [64, 0, 0, 64, 191, 255, 255, 191]  # the page repeats: between its first and last texel


def test_textures_that_materials_share_become_one(tmp_path):
    builder = Builder()
    builder.mesh(quad(builder, 0, material=0), quad(builder, 0, material=1))
    image = RNG.integers(0, 256, (8, 8, 3), np.uint8)
    materials = [rough({"index": 0}), rough({"index": 0}, normalTexture={"index": 0})]
    images = with_images(builder, png(image))
    (tmp_path / "in.glb").write_bytes(builder.glb([{"mesh": 0}], materials=materials, **images))
    asset = packed(tmp_path, load(tmp_path / "in.glb", "out.glb"))
    assert both(asset, 0) == both(asset, 1)
    assert asset.header["materials"][1]["normalTexture"] == {"index": 0}
    assert len(asset.header["images"]) == 2


def test_a_sampler_stays_unless_w_needs_another(tmp_path):
    image = png(np.zeros((8, 8, 3), np.uint8))
    textures = {"textures": [{"source": 0, "sampler": 0}]}
    asset = packed(tmp_path, source(tmp_path, image, rough({"index": 0}), samplers=[{"magFilter": 9728}], **textures))
    occlusion, surface = both(asset)
    assert occlusion == surface
    assert asset.header["textures"][surface["index"]]["sampler"] == 0
    clamped = [{"wrapS": 33071}]
    asset = packed(tmp_path, source(tmp_path, image, rough({"index": 0}), samplers=clamped, **textures))
    first, second = (asset.header["textures"][each["index"]] for each in both(asset))
    assert first["source"] == second["source"]
    assert asset.header["samplers"][second["sampler"]] == clamped[0]
    assert asset.header["samplers"][first["sampler"]]["wrapS"] == 10497


def test_an_occlusion_texture_of_the_file_and_its_image_are_kept_unless_replaced(tmp_path):
    image = RNG.integers(0, 256, (8, 8, 3), np.uint8)
    own = rough({"index": 0}, occlusionTexture={"index": 0, "strength": 0.5})
    file = source(tmp_path, png(image), own)
    kept = "keeps the file's own occlusion textures (primitives: 1)"
    assert packed(tmp_path, file, said=[kept]).header["materials"] == [own]
    asset = packed(tmp_path, file, replace=True)
    assert both(asset)[0] == both(asset)[1] == {"index": 1}
    again = packed(tmp_path, load(tmp_path / "out.glb", "out.glb"), w=1 - W)  # ours is replaced without being asked
    assert np.array_equal(codes_of(again, both(again)[0])[:, :, 0], np.rint((1 - W) * 255))
    assert np.array_equal(codes_of(again, both(again)[0])[:, :, 1:], image[:, :, 1:])


def moved(**fields):
    return {"index": 0, "extensions": {"KHR_texture_transform": fields}}


def test_a_transform_that_moves_nothing_goes(tmp_path):
    image = png(np.zeros((8, 8, 3), np.uint8))
    file = source(tmp_path, image, rough(moved(texCoord=0, scale=[1, 1])), extensionsUsed=["KHR_texture_transform"])
    assert both(packed(tmp_path, file)) == ({"index": 1}, {"index": 1})


APART = ["has its occlusion in images apart from metallic-roughness textures (1)"]
OTHER_UV = np.array([[[0.1, 0.1], [0.9, 0.1], [0.9, 0.9]], [[0.1, 0.1], [0.9, 0.9], [0.1, 0.9]]])


def check_apart(tmp_path, file, reference, uv=0):
    asset = packed(tmp_path, file, uv, said=APART)
    occlusion, surface = both(asset)
    assert surface == reference
    assert occlusion["index"] != reference["index"]
    assert np.array_equal(codes_of(asset, occlusion)[:, :, 0], np.rint(W * 255))


@pytest.mark.parametrize(
    ("reference", "uv"),
    [
        ({"index": 0, "texCoord": 1}, 0),
        (moved(texCoord=1), 0),
        (moved(scale=[2, 2]), 0),
        (moved(rotation=0.5), 0),
        ({"index": 0}, OTHER_UV),
        ({"index": 9}, 0),
    ],
)
def test_an_image_looked_up_elsewhere_stays_and_w_has_one_of_its_own(tmp_path, reference, uv):
    image = png(np.zeros((8, 8, 3), np.uint8))
    check_apart(tmp_path, source(tmp_path, image, rough(reference), (0, 1)), reference, uv)


def test_so_does_an_image_that_cannot_be_read(tmp_path):
    for fields in ({"images": [{"uri": "gone.png"}]}, {"textures": [{"extensions": {"KHR_texture_basisu": {}}}]}):
        check_apart(tmp_path, source(tmp_path, b"", rough({"index": 0}), **fields), {"index": 0})
    check_apart(tmp_path, source(tmp_path, b"no image", rough({"index": 0})), {"index": 0})


def test_a_malformed_reference_is_refused(tmp_path):
    with pytest.raises(MeshError, match=r"metallicRoughnessTexture\.index: expected a whole number"):
        source(tmp_path, png(np.zeros((8, 8, 3), np.uint8)), rough({"index": "x"}))
