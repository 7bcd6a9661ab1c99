"""Textures: what is read, what the pyramid holds, and what a look-up returns."""

import io
import itertools
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from pictures import plain

from obscurance.raytrace.errors import InputError, OptionError
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.raytrace.image.texture import WRAPS, LazyTextures, Texture, pack_textures
from obscurance.raytrace.image.texture_lookup import sample_texture
from obscurance.raytrace.kernel.jit import kernel


@kernel
def look_up(textures, number, u, v, footprint, out):
    for i in range(len(u)):
        out[i, 0], out[i, 1], out[i, 2] = sample_texture(textures, number, u[i], v[i], footprint[i])


def sample(packed, u, v, footprint=0.0, texture=0):
    u, v, footprint = (np.array(each, float).ravel() for each in np.broadcast_arrays(u, v, footprint))
    out = np.empty((len(u), 3))
    look_up(packed, texture, u, v, footprint, out)
    return out


def png(path, codes, **options):
    PIL.Image.fromarray(np.asarray(codes, np.uint8)).save(path, **options)
    return Texture(path)


def codes(height=8, width=8, channels=3, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (height, width, channels), np.uint8)


def level(packed, number):
    start, width, height = packed.levels[number]
    return packed.texels[start : start + width * height].reshape(height, width, 3)


WRAPPED = {
    "repeat": lambda i, n: i % n,
    "mirrored_repeat": lambda i, n: np.where(i // n % 2 == 0, i % n, n - 1 - i % n),
    "clamp_to_edge": lambda i, n: np.clip(i, 0, n - 1),
}


def reference(image, u, v, wrap=("repeat", "repeat")):
    """Bilinear look-up by NumPy: texels of the endless image that a wrap mode stands for."""
    height, width = image.shape[:2]
    across, down = (WRAPPED[mode] for mode in wrap)
    x, y = u * width - 0.5, (1 - v) * height - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    s, t = (x - column)[:, None], (y - row)[:, None]
    at = [[image[down(row + i, height), across(column + j, width)] for j in (0, 1)] for i in (0, 1)]
    return (1 - t) * ((1 - s) * at[0][0] + s * at[0][1]) + t * ((1 - s) * at[1][0] + s * at[1][1])


@pytest.mark.parametrize("wrap", list(itertools.product(WRAPS, WRAPS)))
@pytest.mark.parametrize("size", [(1, 1), (5, 7), (8, 8), (1, 6), (6, 1)])
def test_wrap_modes_against_numpy(tmp_path, size, wrap):
    image = codes(*size)
    packed = pack_textures([replace(png(tmp_path / "a.png", image), wrap=wrap)])
    u, v = np.random.default_rng(1).uniform(-3, 4, (2, 500))
    expected = reference(decode_srgb(image / 255).astype(float), u, v, wrap)
    np.testing.assert_allclose(sample(packed, u, v), expected, atol=1e-9)
    if size == (8, 8):
        halves = reference(level(packed, 1).astype(float), u, v, wrap)
        np.testing.assert_allclose(sample(packed, u, v, 2 / 8), halves, atol=1e-9)


@pytest.mark.parametrize("wrap", ["clamp", ("repeat",), ("repeat", "repeat", "repeat"), (1, 2), None, 3, [[], []]])
def test_a_wrap_mode_that_there_is_not(wrap):
    with pytest.raises(
        OptionError, match="texture: wrap: expected one or two of repeat, mirrored_repeat, clamp_to_edge"
    ):
        Texture(Path("a.png"), wrap=wrap)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300, -1e-300])
def test_coordinates_that_no_texture_has_stay_inside_the_arrays(tmp_path, value, wrap):
    packed = pack_textures([replace(png(tmp_path / "a.png", codes()), wrap=wrap)])
    for u, v, footprint in ((value, 0.5, 0.0), (0.5, value, 0.3), (0.5, 0.5, value)):
        found = sample(packed, u, v, footprint)
        assert ((found >= 0) & (found <= 1)).all()


def test_every_level_of_a_power_of_two_keeps_the_linear_mean(tmp_path):
    image = codes(32, 64)
    packed = pack_textures([png(tmp_path / "a.png", image)])
    sizes = [(64, 32), (32, 16), (16, 8), (8, 4), (4, 2), (2, 1), (1, 1)]
    assert [tuple(row[1:]) for row in packed.levels] == sizes
    linear = decode_srgb(image / 255).astype(float)
    for number in range(len(sizes)):
        np.testing.assert_allclose(level(packed, number).mean(axis=(0, 1)), linear.mean(axis=(0, 1)), rtol=1e-5)
    halves = linear.reshape(16, 2, 32, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(level(packed, 1), halves, atol=1e-6)


def test_between_two_levels(tmp_path):
    packed = pack_textures([png(tmp_path / "a.png", codes(8, 16))])
    u, v = np.random.default_rng(1).random((2, 50))
    fine, coarse = (reference(level(packed, number).astype(float), u, v) for number in (1, 2))
    np.testing.assert_allclose(sample(packed, u, v, 2 / 16), fine, atol=1e-9)
    np.testing.assert_allclose(sample(packed, u, v, 2**1.25 / 16), 0.75 * fine + 0.25 * coarse, atol=1e-9)
    np.testing.assert_allclose(sample(packed, u, v, 4 / 16), coarse, atol=1e-9)


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P", "1"])
def test_channels_and_palettes(tmp_path, mode):
    """Alpha is ignored: the colour is the file's, not faded."""
    source = PIL.Image.fromarray(codes(channels=4) if "A" in mode else codes()).convert(mode)
    source.save(tmp_path / "a.png")
    shown = np.asarray(source.convert("LA" if mode == "LA" else "RGBA" if mode == "RGBA" else "RGB"))
    colour = np.broadcast_to(shown[..., :1] if mode == "LA" else shown[..., :3], (8, 8, 3))
    packed = pack_textures([Texture(tmp_path / "a.png")])
    np.testing.assert_allclose(level(packed, 0), decode_srgb(colour / 255), atol=1e-6)


def test_sixteen_bits(tmp_path):
    grey = np.random.default_rng(0).integers(0, 1 << 16, (8, 8)).astype(np.uint16)
    PIL.Image.fromarray(grey).save(tmp_path / "a.png")
    packed = pack_textures([Texture(tmp_path / "a.png")])
    np.testing.assert_allclose(level(packed, 0)[..., 1], decode_srgb(grey / 65535), atol=1e-6)


def test_floats_are_linear(tmp_path):
    plain((0.5, 3.0, 0.125, 1.0)).save(tmp_path / "a.exr", layers=["beauty"])
    packed = pack_textures([Texture(tmp_path / "a.exr")])
    np.testing.assert_array_equal(level(packed, 0)[4, 5], (0.5, 3.0, 0.125))


def test_only_the_seen_ones_are_read_and_equal_ones_once(tmp_path):
    seen = png(tmp_path / "a.png", codes())
    other = png(tmp_path / "b.png", codes(4, 4, seed=1))
    unseen = Texture(tmp_path / "missing.png")
    lazy = LazyTextures([unseen, seen, other, Texture(tmp_path / "a.png", wrap="clamp_to_edge"), other])
    packed = lazy.packed
    assert packed.depth.tolist() == [0, 0, 0, 0, 0]
    assert packed.first_level[1] == packed.first_level[3]
    assert len(packed.texels) == 64 + 16 + 4 + 1 + 16 + 4 + 1
    lazy.read([3])
    assert packed.depth.tolist() == [0, 4, 0, 4, 0]
    np.testing.assert_array_equal(sample(packed, 0.3, 0.4, texture=2), [[1, 1, 1]])
    lazy.read([1, 2])
    expected = reference(decode_srgb(codes(4, 4, seed=1) / 255).astype(float), np.array([0.3]), np.array([0.4]))
    np.testing.assert_allclose(sample(packed, 0.3, 0.4, texture=2), expected, atol=1e-9)


def test_a_file_that_changes_its_size_while_it_is_used_is_refused(tmp_path):
    lazy = LazyTextures([png(tmp_path / "a.png", codes())])
    png(tmp_path / "a.png", codes(16, 4))
    with pytest.raises(InputError, match="file: expected one that stays as it is"):
        lazy.read([0])


def test_no_textures_are_arrays_that_a_kernel_takes():
    packed = pack_textures([])
    assert packed.texels.shape == (0, 3)
    assert packed.levels.shape == (0, 3)
    assert packed.first_level.shape == packed.depth.shape == (0,)
    assert [each.dtype for each in (packed.texels, packed.levels, packed.first_level)] == [
        np.float32,
        np.int64,
        np.int64,
    ]


def broken(folder):
    whole = io.BytesIO()
    PIL.Image.fromarray(codes(64, 64)).save(whole, "PNG")
    (folder / "cut.png").write_bytes(whole.getvalue()[:5000])
    (folder / "text.png").write_text("not an image")
    (folder / "empty.png").write_bytes(b"")
    (folder / "folder.png").mkdir()
    return {
        "missing.png": "an existing file, got none",
        "cut.png": "a complete image",
        "text.png": "an image",
        "empty.png": "an image",
        "folder.png": "got a folder",
    }


@pytest.mark.parametrize("kind", range(5))
def test_what_cannot_be_read_is_one_line_that_names_the_file(tmp_path, capfd, kind):
    name, message = list(broken(tmp_path).items())[kind]
    path = tmp_path / name
    with pytest.raises(InputError, match=message) as error:
        pack_textures([Texture(path)])
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
    if path.is_file():
        with pytest.raises(InputError, match=message) as error:
            pack_textures([Texture(Path("scene.glb image 2"), path.read_bytes())])
        assert str(error.value).startswith("scene.glb image 2: ")
        assert os.sep not in str(error.value)
    assert capfd.readouterr() == ("", "")


def test_huge_images_are_refused_before_they_are_read(tmp_path):
    path = png(tmp_path / "a.png", codes(1, 16385)).path
    path.write_bytes(path.read_bytes()[:60])  # of the header and few pixels
    with pytest.raises(InputError, match="size: expected at most 16384×16384 pixels, got 16385×1"):
        pack_textures([Texture(path)])
