"""Pictures on disk, read back by OpenImageIO, by Pillow, and by our own reader."""

import numpy as np
import pytest
from pictures import ENDINGS, METADATA, PICTURES, foreign, frame, names, pillow, plain, python

from obscurance.raytrace.image.colour import decode_srgb, encode_srgb
from obscurance.raytrace.image.formats import LAYERS
from obscurance.raytrace.image.read import read_image
from obscurance.raytrace.image.write import write_image

DITHERED = 1  # code by which a pixel of a PNG may differ


def test_all_layers_come_back_from_an_exr_bit_for_bit(tmp_path):
    written = frame()
    written.save(tmp_path / "a.exr", METADATA)
    layers, metadata = read_image(tmp_path / "a.exr")
    assert metadata == METADATA
    assert set(layers) == set(LAYERS)
    for name, layer in written.layers.items():
        np.testing.assert_array_equal(layers[name], layer, name)
        assert layers[name].dtype == np.float32


def test_channels_have_the_names_that_other_programs_look_for(tmp_path):
    written = frame()
    written.save(tmp_path / "a.exr", METADATA)
    spec, pixels = foreign(tmp_path / "a.exr")
    column = {name: pixels[..., i] for i, name in enumerate(spec.channelnames)}
    np.testing.assert_array_equal(np.stack([column[c] for c in "RGBA"], -1), written.layers["beauty"])
    np.testing.assert_array_equal(column["normal.Y"], written.layers["normal"][..., 1])
    np.testing.assert_array_equal(column["depth.Z"], written.layers["depth"][..., 0])
    np.testing.assert_array_equal(column["object_id.ID"], written.layers["object_id"][..., 0])
    np.testing.assert_array_equal(column["obscurance.Y"], written.layers["obscurance"][..., 0])
    assert spec.get_string_attribute("compression") == "zip"
    assert spec.get_string_attribute("obscurance:seed") == "7"


def test_half_halves_all_but_depth_and_object_id(tmp_path):
    written = frame()
    written.layers["diffuse"][3, 4] = (1e6, -1e6, 65504.0)
    written.save(tmp_path / "a.exr", half=True)
    spec, _ = foreign(tmp_path / "a.exr")
    for name, kind in zip(spec.channelnames, spec.channelformats, strict=True):
        assert str(kind) == ("float" if name in ("depth.Z", "object_id.ID") else "half")
    layers, _ = read_image(tmp_path / "a.exr")
    np.testing.assert_array_equal(layers["object_id"], written.layers["object_id"])
    np.testing.assert_array_equal(layers["diffuse"][3, 4], [65504.0, -65504.0, 65504.0])
    np.testing.assert_allclose(layers["albedo"], written.layers["albedo"], rtol=2**-11, atol=2**-24)


def test_chosen_layers_only(tmp_path):
    frame().save(tmp_path / "a.exr", layers=["depth", "beauty"])
    assert set(read_image(tmp_path / "a.exr")[0]) == {"depth", "beauty"}


@pytest.mark.parametrize(
    ("linear", "code"), [(0.0, 0), (0.001, 3), (0.18, 118), (0.5, 188), (1.0, 255), (7.0, 255), (-1.0, 0)]
)
def test_srgb_codes(tmp_path, linear, code):
    plain((linear, linear, linear, 1.0)).save(tmp_path / "a.png")
    assert pillow(tmp_path / "a.png").getpixel((3, 2)) == pytest.approx((code, code, code, 255), abs=DITHERED)
    write_image(tmp_path / "b.png", np.full((20, 30), linear))
    assert pillow(tmp_path / "b.png").getpixel((3, 2)) == pytest.approx(code, abs=DITHERED)
    plain((linear, linear, linear, 1.0)).save(tmp_path / "a.jpg")
    assert pillow(tmp_path / "a.jpg").getpixel((3, 2)) == pytest.approx((code,) * 3, abs=1)


def test_sixteen_bits_in_tiff(tmp_path):
    plain((0.5, 0.25, 0.001, 1.0)).save(tmp_path / "a.tif")
    spec, pixels = foreign(tmp_path / "a.tif")
    assert str(spec.format) == "uint16"
    np.testing.assert_allclose(pixels[0, 0, :3], encode_srgb([0.5, 0.25, 0.001]), atol=0.51 / 65535)
    assert pillow(tmp_path / "a.tif").getpixel((3, 2)) == pytest.approx((188, 137, 3, 255), abs=1)


def test_srgb_transfer():
    linear = np.array([0, 0.0031308, 0.18, 0.214041, 0.5, 1, 7, -1])
    expected = [0, 0.04045, 0.461356, 0.5, 0.735357, 1, 1, 0]
    np.testing.assert_allclose(encode_srgb(linear), expected, atol=2e-6)


@pytest.mark.parametrize("ending", PICTURES)
def test_files_say_that_they_are_srgb(tmp_path, ending):
    plain((0.5, 0.5, 0.5, 1.0)).save(tmp_path / f"a{ending}")
    spec, _ = foreign(tmp_path / f"a{ending}")
    assert spec.get_string_attribute("oiio:ColorSpace").startswith("srgb")


def test_alpha_is_straight_in_png_and_tiff_and_black_shows_through_in_jpeg(tmp_path):
    covered = plain((0.25, 0.125, 0.0, 0.5))
    covered.save(tmp_path / "a.png")
    covered.save(tmp_path / "a.jpg")
    covered.save(tmp_path / "a.tiff")
    assert pillow(tmp_path / "a.png").getpixel((0, 0)) == pytest.approx((188, 137, 0, 128), abs=DITHERED)
    assert pillow(tmp_path / "a.jpg").getpixel((0, 0)) == pytest.approx((137, 99, 0), abs=2)
    spec, _ = foreign(tmp_path / "a.tiff")
    assert spec.get_int_attribute("tiff:UnassociatedAlpha") == 1
    for ending, error in ((".png", 0.008), (".tiff", 2e-5)):
        layers, _ = read_image(tmp_path / f"a{ending}")
        np.testing.assert_allclose(layers["beauty"][0, 0], (0.25, 0.125, 0.0, 0.5), atol=error)


def test_no_coverage_is_transparent_black(tmp_path):
    frame().save(tmp_path / "a.png")
    picture = pillow(tmp_path / "a.png")
    assert picture.mode == "RGBA"
    assert picture.getpixel((0, 5)) == (0, 0, 0, 0)


def test_a_coloured_background_makes_the_picture_opaque(tmp_path):
    written = frame()
    written.layers["beauty"][:, 0, :3] = 0.5
    written.save(tmp_path / "a.png")
    picture = pillow(tmp_path / "a.png")
    assert picture.mode == "RGB"
    assert picture.getpixel((0, 5)) == pytest.approx((188, 188, 188), abs=DITHERED)
    expected = encode_srgb(written.layers["beauty"][..., :3])
    np.testing.assert_allclose(np.asarray(picture) / 255, expected, atol=DITHERED / 255)


def test_one_layer_of_fractions_as_a_grey_picture(tmp_path):
    written = frame()
    written.save(tmp_path / "a.png", layers=["shadow"])
    picture = pillow(tmp_path / "a.png")
    assert picture.mode == "L"
    expected = encode_srgb(written.layers["shadow"][..., 0])
    np.testing.assert_allclose(np.asarray(picture) / 255, expected, atol=DITHERED / 255)


@pytest.mark.parametrize("ending", ENDINGS)
def test_metadata_comes_back(tmp_path, ending):
    frame().save(tmp_path / f"a{ending}", METADATA)
    assert read_image(tmp_path / f"a{ending}")[1] == METADATA
    frame().save(tmp_path / f"b{ending}")
    assert read_image(tmp_path / f"b{ending}")[1] == {}


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_same_picture_gives_the_same_bytes_without_a_time(tmp_path, ending):
    for name in ("a", "b"):
        frame().save(tmp_path / f"{name}{ending}", METADATA)
    first, second = ((tmp_path / f"{name}{ending}").read_bytes() for name in ("a", "b"))
    assert first == second
    assert not any(word in first for word in (b"capDate", b"DateTime", b"tIME"))
    spec, _ = foreign(tmp_path / f"a{ending}")
    assert spec.get_string_attribute("DateTime") == ""
    frame(seed=1).save(tmp_path / f"b{ending}", METADATA)
    assert (tmp_path / f"b{ending}").read_bytes() != first


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("size", [(1, 1), (63, 2), (64, 1), (65, 3)])
def test_sizes_around_a_block_of_rows(tmp_path, ending, size):
    written = frame(*size)
    written.save(tmp_path / f"a{ending}")
    assert read_image(tmp_path / f"a{ending}")[0]["beauty"].shape[:2] == size


@pytest.mark.parametrize("name", ["a?b=1.exr", "ä ö #%d.png", "x.0001.tif"])
def test_names_that_libraries_like_to_interpret(tmp_path, name):
    frame().save(tmp_path / name)
    assert names(tmp_path) == [name]
    assert "beauty" in read_image(tmp_path / name)[0]


def test_a_frame_takes_little_memory_beside_itself(tmp_path):
    """The rows in hand, not a second frame; measured after a small one has loaded the libraries."""
    code = f"""
import resource
from pictures import frame
frame().save({str(tmp_path / "small.exr")!r})
large = frame(350, 1500)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
large.save({str(tmp_path / "large.exr")!r})
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)
"""
    assert float(python(code).stdout) < 25  # MiB; the frame has 46


def test_colours_below_black_are_decoded_without_a_warning():
    np.testing.assert_allclose(decode_srgb([-1.0, 0.0, 1.0]), [-1 / 12.92, 0, 1])
