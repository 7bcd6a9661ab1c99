"""Holes are filled from what is known, which keeps every bit."""

import numpy as np
import pytest

from obscurance.raytrace.image.fill import fill_holes


@pytest.fixture
def page():
    random = np.random.default_rng(0)
    known = np.zeros((96, 160), np.bool_)
    known[10:40, 20:60] = known[70:71, 3:150] = known[95, 159] = True
    return random.random((96, 160, 3)).astype(np.float32), known


def test_what_is_known_keeps_every_bit(page):
    pixels, known = page
    assert np.array_equal(fill_holes(pixels, known)[known], pixels[known])


def test_the_whole_page_is_filled_within_the_range_of_what_is_known(page):
    pixels, known = page
    filled = fill_holes(pixels, known)
    assert np.isfinite(filled).all()
    assert (filled >= pixels[known].min(axis=0) - 1e-6).all()
    assert (filled <= pixels[known].max(axis=0) + 1e-6).all()


def test_what_is_not_known_does_not_matter(page):
    pixels, known = page
    other = np.where(known[:, :, None], pixels, np.float32(7.0))
    assert np.array_equal(fill_holes(pixels, known), fill_holes(other, known))


def test_one_value_fills_all(page):
    _, known = page
    assert np.allclose(fill_holes(np.full((*known.shape, 1), 0.3, np.float32), known), 0.3, atol=1e-6)


def test_pixels_beside_known_ones_are_like_them(page):
    _, known = page
    ramp = np.broadcast_to(np.linspace(0, 1, 160, dtype=np.float32)[:, None], (96, 160, 1))
    filled = fill_holes(np.ascontiguousarray(ramp), known)[:, :, 0]
    assert np.abs(filled[69, 3:150] - ramp[0, 3:150, 0]).max() < 0.03


def test_nothing_known_and_all_known_stay_as_they_are(page):
    pixels, known = page
    for which in (np.zeros_like(known), np.ones_like(known)):
        assert np.array_equal(fill_holes(pixels, which), pixels)


@pytest.mark.parametrize("threads", [1, 3])
def test_far_pixels_are_bilinear_lookups_of_coarser_means(threads):
    """A page of 5×3 pixels, of which three are known: the pyramid by hand."""
    known = np.zeros((3, 5), np.bool_)
    known[0, 0] = known[1, 1] = known[2, 4] = True
    filled = fill_holes(np.where(known, [[0.1], [0.3], [0.8]], np.nan).astype(np.float32)[:, :, None], known, threads)
    quarter = 0.2, 0.8  # known at half the size at (0, 0) and at (1, 2)
    left, middle = quarter[0], 0.75 * quarter[0] + 0.25 * quarter[1]  # of both rows of half the size
    assert filled[1, 2, 0] == pytest.approx(0.75 * middle + 0.25 * left, abs=1e-6)
    assert filled[0, 1, 0] == pytest.approx(0.75 * left + 0.25 * middle, abs=1e-6)
