"""PNG output: the sRGB transfer, and files that appear whole or not at all."""

import numpy as np
import pytest

from raytrace.errors import OutputError
from raytrace.image import encode_srgb, write_image


def test_srgb_transfer():
    linear = np.array([0, 0.0031308, 0.18, 0.214041, 0.5, 1, 7, -1])
    expected = [0, 0.04045, 0.461356, 0.5, 0.735357, 1, 1, 0]
    np.testing.assert_allclose(encode_srgb(linear), expected, atol=2e-6)


def test_pixels_come_back(tmp_path):
    import OpenImageIO as oiio

    pixels = np.random.default_rng(0).random((5, 7, 3)).astype(np.float32)
    write_image(tmp_path / "a.png", pixels)
    stored = oiio.ImageBuf(str(tmp_path / "a.png")).get_pixels(oiio.UINT8)
    assert stored.shape == (5, 7, 3)
    np.testing.assert_array_equal(stored, np.round(encode_srgb(pixels) * 255).astype(np.uint8))
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_a_folder_that_does_not_exist(tmp_path):
    with pytest.raises(OutputError, match="nowhere"):
        write_image(tmp_path / "nowhere" / "a.png", np.zeros((2, 2, 3)))
