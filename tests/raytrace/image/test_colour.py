"""PNG of 8 bits without bands: means stay, codes stay codes, the same bytes again."""

import numpy as np
import pytest
from meshes import two_boxes
from pictures import plain

from obscurance.raytrace import AmbientLight, Camera, Lambert, Object, Scene, Settings, Shape, render
from obscurance.raytrace.image import write
from obscurance.raytrace.image.colour import decode_srgb, dithered
from obscurance.raytrace.image.read import open_image
from obscurance.scenes.formats.images import write_grey


def codes(path):
    import OpenImageIO as oiio

    return open_image(path).read_image(oiio.UINT8)


def test_what_is_a_code_stays_flat():
    flat = (np.arange(256) / 255).astype(np.float32)[:, None, None].repeat(200, 1).repeat(3, 2)
    assert (dithered(flat) == np.arange(256)[:, None, None]).all()
    with_errors = np.nextafter(flat, 2, dtype=np.float32).clip(0, 1)
    assert (dithered(with_errors) == np.arange(256)[:, None, None]).all()


@pytest.mark.parametrize("fraction", [0.1, 0.3, 0.5, 0.9])
def test_means_stay_also_over_a_few_pixels(fraction):
    found = dithered(np.full((240, 240, 1), (100 + fraction) / 255, np.float32))[..., 0]
    assert set(np.unique(found)) == {100, 101}
    assert found.mean() == pytest.approx(100 + fraction, abs=0.002)
    means = found.reshape(60, 4, 60, 4).mean(axis=(1, 3))
    assert means.std() < 0.7 * (fraction * (1 - fraction) / 16) ** 0.5  # of white noise


def test_rows_go_on_from_block_to_block(tmp_path):
    """Of 64 rows; the second picture's begin elsewhere."""
    ramp = np.linspace(0.2, 0.25, 150 * 64, dtype=np.float32).reshape(150, 64, 1).repeat(4, 2)
    ramp[..., 3] = 1
    write.write_picture(tmp_path / "a.png", ramp, {})
    write.write_picture(tmp_path / "b.png", ramp[37:], {}, corner=(0, 37))
    shown = codes(tmp_path / "a.png")
    np.testing.assert_array_equal(shown[37:], codes(tmp_path / "b.png"))
    assert (shown[..., 0] == shown[..., 1]).all()
    assert (shown[..., 3] == 255).all()
    assert abs(decode_srgb(shown[..., 0] / 255).mean() - ramp[..., 0].mean()) < 1e-4
    write.write_picture(tmp_path / "a.jpg", ramp, {})
    plain((0.5, 0.5, 0.5, 0.5)).save(tmp_path / "half.png")
    assert (codes(tmp_path / "half.png")[..., 3] == 128).all()


def test_a_crop_has_the_pixels_of_the_whole(tmp_path):
    scene = Scene((Object(Shape(two_boxes(), Lambert(albedo=0.8))),), (AmbientLight(),), (0.1, 0.2, 0.3))
    camera = Camera.framing(two_boxes(), aspect=1.5)
    for name, crop in (("whole", None), ("part", (30, 17, 40, 21))):
        render(scene, camera, Settings(width=96, height=64, samples=4, crop=crop)).save(tmp_path / f"{name}.png")
    np.testing.assert_array_equal(codes(tmp_path / "whole.png")[17:38, 30:70], codes(tmp_path / "part.png"))


def test_w_of_8_bits_is_dithered_and_of_16_is_not(tmp_path):
    w = np.linspace(0.5, 0.51, 64 * 64, dtype=np.float32).reshape(64, 64)
    w[:8] = 1
    write_grey(tmp_path / "8.png", w, False, {}, 8)
    write_grey(tmp_path / "16.png", w, False, {}, 16)
    shown = codes(tmp_path / "8.png")[..., 0]
    assert (shown[:8] == 255).all()
    assert shown[8:].mean() == pytest.approx(255 * w[8:].mean(), abs=0.02)
    assert (np.diff(shown[20].astype(int)) != 0).sum() > 10
