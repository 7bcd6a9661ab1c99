"""Error figures of pictures whose difference is known."""

import math

import numpy as np
import PIL.Image
import pytest
from pictures import frame, plain
from scipy.ndimage import gaussian_filter

from obscurance.raytrace.errors import InputError, OptionError
from obscurance.raytrace.image.compare import Comparison, compare
from obscurance.raytrace.image.write import write_image


def exr(path, pixels):
    """Write RGB pixels, opaque."""
    pixels = np.asarray(pixels, np.float32)
    picture = plain((0, 0, 0, 1), *pixels.shape[:2])
    picture.layers["beauty"][..., :3] = pixels
    picture.save(path)
    return path


def checkerboard(size=64, square=8):
    row = np.arange(size) // square
    return np.repeat(((row[:, None] + row) % 2)[..., None], 3, axis=2).astype(np.float32)


def test_a_picture_equals_itself(tmp_path):
    path = tmp_path / "a.exr"
    frame().save(path)
    assert compare(path, path) == Comparison(0.0, 0.0, 0.0, math.inf, 0.0)


def test_figures_of_a_known_difference(tmp_path):
    pixels = np.full((20, 30, 3), 0.5, np.float32)
    other = pixels.copy()
    other[:10] += 0.1
    other[0, 0, 2] = 1.5
    found = compare(exr(tmp_path / "a.exr", pixels), exr(tmp_path / "b.exr", other))
    difference = np.abs(other.astype(float) - pixels)
    assert found.mean_error == pytest.approx(difference.mean())
    assert found.rms_error == pytest.approx(math.sqrt((difference**2).mean()))
    assert found.max_error == pytest.approx(1.0)
    assert found.psnr == pytest.approx(20 * math.log10(1.5 / found.rms_error))
    assert 0 < found.flip < 1


def test_black_and_white_are_almost_as_far_apart_as_flip_goes(tmp_path):
    found = compare(exr(tmp_path / "a.exr", np.zeros((40, 40, 3))), exr(tmp_path / "b.exr", np.ones((40, 40, 3))))
    assert found.flip == pytest.approx(0.967, abs=0.005)


def test_flip_grows_with_blur_and_with_noise(tmp_path):
    sharp = checkerboard()
    noise = np.random.default_rng(0).standard_normal(sharp.shape)
    reference = exr(tmp_path / "a.exr", sharp)
    figures = []
    for sigma in (0, 0.5, 1, 2, 4):
        figures.append(compare(reference, exr(tmp_path / "b.exr", gaussian_filter(sharp, (sigma, sigma, 0)))).flip)
    assert figures[0] == 0
    assert (np.diff(figures) > 0).all()
    figures = [compare(reference, exr(tmp_path / "b.exr", sharp + s * noise)).flip for s in (0.01, 0.05, 0.2)]
    assert (np.diff(figures) > 0).all()


def test_formats_may_differ(tmp_path):
    """A PNG of the same frame differs by the rounding to 8 bits and by nothing else."""
    picture = frame()
    picture.layers["beauty"][..., :3] = np.minimum(picture.layers["beauty"][..., :3], 1)
    picture.layers["beauty"][:, 1:, 3] = 1
    picture.save(tmp_path / "a.exr")
    picture.save(tmp_path / "a.png")
    found = compare(tmp_path / "a.exr", tmp_path / "a.png")
    assert found.max_error < 0.0091  # a code where the transfer is steepest: 2.4 / 1.055 / 255
    assert found.flip < 0.02


def test_grey_and_colour(tmp_path):
    grey = np.full((20, 30), 0.5)
    write_image(tmp_path / "a.png", grey)
    write_image(tmp_path / "b.png", np.repeat(grey[..., None], 3, axis=2))
    assert compare(tmp_path / "a.png", tmp_path / "b.png").max_error == 0


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite_never_pass(tmp_path, value):
    pixels = np.zeros((20, 30, 3))
    a = exr(tmp_path / "a.exr", pixels)
    pixels[3, 4, 1] = value
    with pytest.raises(InputError, match=r"b\.exr: pixels: expected finite values, got 1 that"):
        compare(a, exr(tmp_path / "b.exr", pixels))


def test_a_file_without_colour(tmp_path):
    frame().save(tmp_path / "a.exr", layers=["depth"])
    with pytest.raises(InputError, match="channels: expected R, G, B or a grey channel, got layers depth"):
        compare(tmp_path / "a.exr", tmp_path / "a.exr")


def test_thresholds():
    found = Comparison(0.1, 0.2, 0.3, 14.0, 0.05)
    assert found.within(0.05)
    assert not found.within(0.0499)
    assert found.within(0.2, "rms")
    assert not found.within(0.2, "max")
    assert not Comparison(0.1, math.nan, 0.3, 14.0, 0.05).within(1.0, "rms")
    with pytest.raises(OptionError, match="metric: expected one of flip, rms, max, got ssim"):
        found.within(0.1, "ssim")
    for threshold in (-1.0, math.nan):
        with pytest.raises(OptionError, match="threshold"):
            found.within(threshold)


def test_the_difference_as_a_picture(tmp_path):
    pixels = np.zeros((40, 60, 3))
    a = exr(tmp_path / "a.exr", pixels)
    pixels[:, 30:] = 1
    compare(a, exr(tmp_path / "b.exr", pixels), tmp_path / "d.png")
    with PIL.Image.open(tmp_path / "d.png") as picture:
        assert picture.size == (60, 40)
        assert max(picture.getpixel((3, 20))) < 10
        assert min(picture.getpixel((57, 20))[:2]) > 200
    compare(a, a, tmp_path / "d.png")
    with PIL.Image.open(tmp_path / "d.png") as picture:
        assert max(picture.getpixel((57, 20))) < 10
