"""Where faces overlap on a page, a texel is the mean over all of them, however many they are."""

import numpy as np
import pytest

from obscurance import ao, scenes

pytestmark = pytest.mark.usefixtures("w_alone")

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
HALVES = np.array([[0, 1, 2], [0, 2, 3]])
LID = scenes.Box(size=(2, 2, 2), fineness=2).geometry().mesh


def one_dark_of(count):
    """Squares far apart that all have the whole page; `LID` encloses the first of them."""
    square = np.column_stack([SQUARE - 0.5, np.zeros(4)])
    places = np.concatenate([square + np.array([30 * k, 0, 0]) for k in range(count)])
    faces = np.concatenate([HALVES + 4 * k for k in range(count)])
    uv = np.tile(SQUARE[HALVES], (count, 1, 1))
    return (places, faces), uv


@pytest.mark.parametrize("samples", [1, 8, 64])
@pytest.mark.parametrize("size", [1, 5])
def test_each_of_any_number_of_layers_counts_alike(size, samples):
    for count in (*range(1, 10), 15, 16, 17, 31, 32, 33, 40):
        mesh, uv = one_dark_of(count)
        baked = ao.bake_texture(
            mesh, uv, size, falloff=ao.Binary(max_distance=9.0), samples=samples, occluders=[LID], interior="ignore"
        )
        assert np.allclose(baked.w, 1 - 1 / count, atol=1e-6)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("count", [65, 100, 230])
def test_texels_leave_out_different_ones_of_more_layers_than_they_have_samples(count, seed):
    mesh, uv = one_dark_of(count)
    falloff, size = ao.Binary(max_distance=9.0), 32
    baked = ao.bake_texture(
        mesh, uv, size, falloff=falloff, samples=8, occluders=[LID], interior="ignore", denoise=False, seed=seed
    )
    standard_error = np.sqrt((64 / count) * (1 - 64 / count)) / 64 / size
    assert abs(np.mean(baked.w, dtype=float) - (1 - 1 / count)) < 4 * standard_error + 1e-6
