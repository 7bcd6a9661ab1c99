"""Reading pictures of every kind, whole and damaged."""

import os

import numpy as np
import OpenImageIO as oiio
import PIL.Image
import pytest
from pictures import METADATA, frame

from obscurance.raytrace.errors import InputError
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.raytrace.image.read import read_image


@pytest.mark.parametrize("ending", [".exr", ".png", ".tif", ".jpg"])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.95])
def test_a_file_cut_off_is_one_line(tmp_path, capfd, ending, share):
    path = tmp_path / f"a{ending}"
    frame().save(path, METADATA)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError) as error:
        read_image(path)
    assert str(error.value).startswith(f"{path}: content: expected ")
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def unreadable(folder):
    (folder / "text.png").write_text("not an image\n")
    (folder / "folder.png").mkdir()
    (folder / "null.png").symlink_to(os.devnull)
    return {
        "missing.png": "existing file, got none",
        "text.png": "content",
        "text.png/a.png": "Not a directory",
        "folder.png": "folder",
        "null.png": "regular",
        "n" * 300: "too long",
    }


@pytest.mark.parametrize("kind", range(6))
def test_files_that_are_no_images(tmp_path, kind):
    name, message = list(unreadable(tmp_path).items())[kind]
    with pytest.raises(InputError, match=message) as error:
        read_image(tmp_path / name)
    assert str(error.value).startswith(str(tmp_path / name))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P", "1", "I;16"])
def test_pictures_by_pillow(tmp_path, mode):
    codes = np.random.default_rng(0).integers(0, 256, (9, 11, 4), np.uint8)
    if mode == "I;16":
        grey = codes[..., 0].astype(np.uint16) * 257
        PIL.Image.fromarray(grey).save(tmp_path / "a.png")
        expected = decode_srgb(codes[..., :1] / 255)
    else:
        picture = PIL.Image.fromarray(codes if mode in ("LA", "RGBA") else codes[..., :3]).convert(mode)
        picture.save(tmp_path / "a.png")
        shown = np.asarray(picture.convert({"P": "RGB", "1": "L"}.get(mode, mode))).reshape(9, 11, -1) / 255
        expected = decode_srgb(shown)
        if mode in ("LA", "RGBA"):
            expected[..., -1] = shown[..., -1]
            expected[..., :-1] *= shown[..., -1:]
    layers, _ = read_image(tmp_path / "a.png")
    np.testing.assert_allclose(layers["beauty"][..., : expected.shape[2]], expected, atol=1e-6)


@pytest.mark.parametrize("ending", [".exr", ".tif"])
def test_tiles_and_windows_of_other_programs(tmp_path, ending):
    pixels = np.random.default_rng(0).random((100, 130, 3), np.float32)
    spec = oiio.ImageSpec(130, 100, 3, "float")
    spec.x, spec.y, spec.full_width, spec.full_height = 10, 20, 300, 200
    for side in (0, 32):
        spec.tile_width = spec.tile_height = side
        output = oiio.ImageOutput.create(str(tmp_path / f"a{ending}"))
        assert output.open(str(tmp_path / f"a{ending}"), spec)
        assert output.write_image(pixels)
        output.close()
        np.testing.assert_array_equal(read_image(tmp_path / f"a{ending}")[0]["beauty"], pixels)


def test_an_image_that_claims_to_be_huge(tmp_path):
    """A few bytes that would fill the memory."""
    output = oiio.ImageOutput.create("png")
    output.open(str(tmp_path / "a.png"), oiio.ImageSpec(40000, 1, 1, "uint8"))
    output.write_image(np.zeros((1, 40000, 1), np.uint8))
    output.close()
    with pytest.raises(InputError, match=r"a\.png: size: expected at most 32768×32768 pixels, got 40000×1"):
        read_image(tmp_path / "a.png")


def test_stray_bytes_in_a_jpeg_are_no_fault(tmp_path, capfd):
    """Cameras leave them; every viewer shows such files."""
    frame().save(tmp_path / "a.jpg")
    content = (tmp_path / "a.jpg").read_bytes()
    (tmp_path / "b.jpg").write_bytes(content[:-2] + b"\0\0" + content[-2:])
    whole, stray = (read_image(tmp_path / name)[0]["beauty"] for name in ("a.jpg", "b.jpg"))
    np.testing.assert_array_equal(whole, stray)
    assert capfd.readouterr() == ("", "")
