"""Textures in pictures: each file is read once, and only where a ray meets it."""

from collections import Counter

import numpy as np
import PIL.Image
import pytest

import obscurance.raytrace.image.texture as module
from obscurance.raytrace import (
    AmbientLight,
    Camera,
    InputError,
    Lambert,
    Mesh,
    Object,
    Scene,
    Settings,
    Shape,
    Texture,
    render,
)
from obscurance.raytrace.image.colour import decode_srgb

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
FACES = [[0, 1, 2], [0, 2, 3]]
SIDE = 4
AHEAD = Camera(position=(SIDE / 2, SIDE / 2, 3), target=(SIDE / 2, SIDE / 2, 0), up=(0, 1, 0), height=float(SIDE))
LIGHTS = (AmbientLight(intensity=(1, 1, 1)),)


def tile(texture, x, y):
    shift = np.eye(4)
    shift[:2, 3] = x, y
    return Object(Shape(Mesh(QUAD, FACES), Lambert(albedo=1.0), QUAD[:, :2], texture), shift)


@pytest.mark.parametrize("threads", [1, 3])
def test_each_file_is_read_once_and_no_more_than_rays_meet(tmp_path, watch, threads):
    colours = np.random.default_rng(2).integers(0, 255, (SIDE * SIDE, 3)).astype(np.uint8)
    items = []
    for number, colour in enumerate(colours):
        PIL.Image.new("RGB", (64, 32), tuple(colour.tolist())).save(tmp_path / f"{number}.png")
        items.append(tile(Texture(tmp_path / f"{number}.png"), number % SIDE, number // SIDE))
    (tmp_path / "broken.png").write_bytes(b"no image")
    items += [tile(Texture(tmp_path / "broken.png"), -9, 0), tile(Texture(tmp_path / "0.png"), -9, 0)]
    built = watch(f"{module.__name__}._build_pyramid")
    size = 32 * SIDE
    frame = render(Scene(tuple(items), LIGHTS), AHEAD, Settings(size, size, samples=5), threads=threads)
    assert Counter(texture.path.name for _, _, texture in built) == {
        f"{number}.png": 1 for number in range(SIDE * SIDE)
    }
    middles = frame.layers["beauty"][16::32, 16::32, :3][::-1].reshape(-1, 3)
    np.testing.assert_allclose(middles, decode_srgb(colours / 255), atol=1e-6)
    with pytest.raises(InputError, match=r"broken\.png: content: expected an image"):
        render(Scene((items[-2],), LIGHTS), Camera(position=(-8.5, 0.5, 3), target=(-8.5, 0.5, 0), up=(0, 1, 0)))
