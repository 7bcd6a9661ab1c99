"""Images and textures that do not fit into memory are refused before they are decoded."""

import subprocess
import sys

import numpy as np
import pytest
from meshes import hills
from PIL import Image
from project import ROOT

from obscurance.raytrace import Lambert, MemoryLimitError, Mesh, Object, Scene, Settings, Shape
from obscurance.raytrace.image.compare import compare
from obscurance.raytrace.image.read import read_image
from obscurance.raytrace.image.texture import Texture, pack_textures, texture_alpha, texture_codes
from obscurance.raytrace.lights.environment import read_environment
from obscurance.raytrace.renderer.render import rendering_bytes
from obscurance.scenes.asset.material import is_opacity_map

MIB = 1 << 20
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="measures by /proc")


def test_textures_are_counted_once_each_by_their_headers(tmp_path):
    mesh = Mesh(*hills(4))

    def needed(*names):
        places = [Texture(tmp_path / name) for name in names]
        shapes = [Shape(mesh, Lambert(albedo=0.5), np.zeros((16, 2)), place) for place in places]
        items = [Object(shape) for shape in shapes or [Shape(mesh, Lambert(albedo=0.5))]]
        return rendering_bytes(Scene(tuple(items)), Settings(width=64, height=64), False, threads=1)

    for name, size in (("large.png", (512, 256)), ("small.jpg", (64, 32))):
        Image.new("RGB", size).save(tmp_path / name)
    (tmp_path / "damaged.png").write_bytes(b"no image")
    large, small = 512 * 256, 64 * 32
    assert needed("damaged.png") == needed()
    assert needed("large.png") - needed() == 28 * large
    another = needed("large.png", "damaged.png") - needed("large.png")  # of the second object
    assert needed("large.png", "large.png") - needed("large.png") == another
    assert needed("large.png", "small.jpg") - needed("large.png") - another == 16 * small


def noise(path):
    pixels = np.random.default_rng(len(path.name)).integers(0, 256, (512, 1024, 3), np.uint8)
    Image.fromarray(pixels).save(path)
    return path


@pytest.mark.parametrize(
    "read",
    [
        lambda path: compare(path, path),
        read_image,
        read_environment,
        lambda path: texture_codes(Texture(path)),
        lambda path: texture_alpha(Texture(path)),
        lambda path: pack_textures([Texture(path)]),
        lambda path: is_opacity_map(path, None),
    ],
    ids=["compare", "image", "environment", "codes", "alpha", "pack", "opacity map"],
)
def test_images_are_not_decoded_if_they_would_not_fit(read, tmp_path, available_memory):
    path = noise(tmp_path / "t.png")
    read(path)
    available_memory(MIB)
    path.write_bytes(path.read_bytes()[:1000])  # whose pixels cannot be decoded
    with pytest.raises(MemoryLimitError, match=r"t\.png: memory: expected at most 1 MiB.* (1,024×512|524,288)"):
        read(path)


def test_pictures_that_differ_take_more_to_compare(tmp_path, available_memory):
    a, b = noise(tmp_path / "a.png"), noise(tmp_path / "other.png")
    available_memory(50 * MIB)
    assert compare(a, a).flip == 0
    with pytest.raises(MemoryLimitError, match=r"a\.png: memory: .* to compare 1,024×512 pixels"):
        compare(a, b)


@LINUX
def test_textures_take_what_is_estimated(tmp_path):
    Image.new("RGB", (2048, 2048)).save(tmp_path / "t.png")
    code = """
import sys
from pathlib import Path
from obscurance.raytrace.image.texture import Texture, pack_textures, texture_bytes
def status(field):
    return next(int(line.split()[1]) << 10 for line in open("/proc/self/status") if line.startswith(field + ":"))
texture = Texture(Path(sys.argv[1]))
estimated = texture_bytes([texture], 1)
before = status("VmRSS")
Path("/proc/self/clear_refs").write_text("5")
pack_textures([texture])
print((status("VmHWM") - before) / estimated)
"""
    command = [sys.executable, "-c", code, tmp_path / "t.png"]
    result = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert 0.7 < float(result.stdout) < 1.2
