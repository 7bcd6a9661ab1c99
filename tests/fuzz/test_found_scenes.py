"""One small case for each fault in scenes and images that fuzzing or its preparation found: evidence/reliability.md."""

import struct
import time
import tracemalloc
import zlib

import fuzz_seeds
import numpy as np
import OpenImageIO as oiio
import pytest
from found_faults import PLANE, scene_mistake
from fuzz_mutations import toml_text
from mesh_files import obj
from meshes import hills

from obscurance.raytrace import CookTorrance
from obscurance.raytrace.errors import LINE, InputError, SceneError
from obscurance.raytrace.image.read import read_image
from obscurance.raytrace.image.texture import Texture, pack_textures
from obscurance.scenes.description.obscurance import with_obscurance
from obscurance.scenes.description.read import read_scene


def test_messages_are_printable_and_short(tmp_path):
    message = scene_mistake(tmp_path, 'background = "\\u001b[31m"\n' + toml_text(PLANE))
    assert r"\x1b[31m" in message
    long = InputError("m.ply", "f" * 5000, "e", "g\n" * 5000)
    assert len(str(long)) < 700
    assert str(long).isprintable()
    assert (long.field, long.got) == ("f" * 5000, "g\n" * 5000)
    assert len(str(InputError("\n" * 5000, "f", "e", "g"))) == LINE


def test_toml_keys_of_very_many_parts(tmp_path):
    start = time.process_time()
    for key in ("a.", '"a b" . ', "'.'."):
        text = "objects." + key * 20_000 + "b = 1\n"
        assert "keys of fewer than 100 parts" in scene_mistake(tmp_path, text)
    assert time.process_time() - start < 2
    numbers = "background = [" + "0.5," * 500 + "]\n" + toml_text(PLANE)
    assert "background: expected" in scene_mistake(tmp_path, numbers)


def test_copies_in_a_toml_scene_end_somewhere(tmp_path):
    (tmp_path / "m.obj").write_bytes(obj(*hills(60)))
    copied = {"mesh": "m.obj", "copies": [{}] * 1000}
    message = scene_mistake(tmp_path, toml_text({"objects": [copied, copied]}))
    assert "m.toml: objects[1].copies: expected at most 20,000,000 vertices and triangles" in message


def test_objects_are_counted_before_they_are_placed(tmp_path):
    (tmp_path / "paint.png").write_bytes(fuzz_seeds.image("png"))
    (tmp_path / "quad.glb").write_bytes(fuzz_seeds.quad_glb())
    copies = [{"mesh": "quad.glb", "copies": [{}] * 20_000}]
    message = scene_mistake(tmp_path, toml_text({"objects": copies}))
    assert "m.toml: objects[0].copies: expected at most 100,000 objects with all copies, got 140,000" in message


@pytest.mark.parametrize(
    ("added", "expected"),
    [
        ({"builtin": "sphere", "fineness": 1e-3}, "objects[1].fineness: expected at most 1,500,000 triangles of built"),
        ({"builtin": "sponge", "fineness": 1e-3}, "objects[1].fineness: expected at most 1,500,000 triangles of built"),
        ({"builtin": "cylinder", "height": 1e6, "fineness": 1}, "objects[1].fineness: expected at most 1,500,000"),
        ({"builtin": "box", "fineness": 1e-90}, "objects[1].fineness: expected at most 1,500,000 triangles of built"),
        ({"builtin": "temple", "fineness": 0.0274}, "objects[1].fineness: expected at most 1,500,000 triangles of"),
        ({"builtin": "temple", "copies": [{}] * 20}, "objects[1].copies: expected at most 1,500,000 triangles of"),
    ],
)
def test_built_in_shapes_are_counted_before_they_are_made(tmp_path, added, expected):
    """Of 1.5 million triangles, which take 36 MB of indices alone."""
    text = toml_text({"objects": [*PLANE["objects"], added]})
    tracemalloc.start()
    try:
        assert f"m.toml: {expected}" in scene_mistake(tmp_path, text)
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


def test_built_in_shapes_that_do_not_fit_into_memory_are_not_made(tmp_path, available_memory):
    available_memory(100 << 20)
    text = toml_text({"objects": [{"builtin": "sphere", "fineness": 0.003}]})
    assert "memory: expected at most 100 MiB, what is available, got about 209 MiB to make" in scene_mistake(
        tmp_path, text
    )


@pytest.mark.parametrize("ending", ["npy", "npz"])
@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (b"(4,), }" + b" " * 9, b"(9999999999,), }", "w: expected 4 values, .*, got 9,999,999,999"),
        (b"<f4'", b"|O8'", "w: expected numbers, got object"),
        (b"(4,), }", b"(4,), (", "content: expected w as obscurance bake writes it"),
        (b"(4,), }", b"(4L,),}", None),
        (b"\x93NUMPY", b"", "content: expected w as obscurance bake writes it"),
    ],
)
def test_baked_files_are_not_trusted(tmp_path, ending, old, new, expected):
    """Headers of huge, broken and old arrays."""
    content = fuzz_seeds.arrays()[0]
    assert old in content
    content = content.replace(old, new)
    (tmp_path / f"w.{ending}").write_bytes(content if ending == "npy" else fuzz_seeds.archive(**{"w.npy": content}))
    (tmp_path / "m.toml").write_text(toml_text(PLANE | {"obscurance": {"baked": f"w.{ending}"}}))
    description = read_scene(tmp_path / "m.toml")
    if expected is None:
        with_obscurance(description)
        return
    with pytest.raises(SceneError, match=rf"w\.{ending}: {expected}"):
        with_obscurance(description)


def png(width, height, rows=b""):
    """A PNG that claims a size."""
    body = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    made = b"\x89PNG\r\n\x1a\n"
    for kind, content in ((b"IHDR", body), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")):
        made += struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
    return made


def test_images_that_claim_more_than_they_can_hold(tmp_path):
    (tmp_path / "m.png").write_bytes(png(16000, 16000))
    with pytest.raises(InputError, match="size: expected pixels that 65 bytes can hold, got 16000×16000 of 3 channels"):
        read_image(tmp_path / "m.png")
    flat = oiio.ImageOutput.create("png")
    assert flat.open(str(tmp_path / "flat.png"), oiio.ImageSpec(3000, 3000, 3, "uint8"))
    flat.write_image(np.zeros((3000, 3000, 3), np.uint8))
    flat.close()
    assert read_image(tmp_path / "flat.png")[0]["beauty"].shape == (3000, 3000, 3)


def test_an_exr_whose_message_is_no_text(tmp_path):
    content = bytearray(fuzz_seeds.image("openexr", 20, 30, 4, "half"))
    content[content.index(b"channels\0chlist\0")] = 0x80
    (tmp_path / "m.exr").write_bytes(bytes(content))
    with pytest.raises(InputError, match="content: expected an image") as error:
        read_image(tmp_path / "m.exr")
    assert str(error.value).isprintable()


def test_an_image_without_pixels(tmp_path):
    (tmp_path / "m.ppm").write_bytes(b"P6\n7 0\n255\n")
    with pytest.raises(InputError, match=r"m\.ppm: "):
        read_image(tmp_path / "m.ppm")
    content = bytearray(fuzz_seeds.image("targa"))
    content[14:16] = bytes(2)
    (tmp_path / "m.tga").write_bytes(content)
    with pytest.raises(InputError, match=r"m\.tga: "):
        pack_textures([Texture(tmp_path / "m.tga")])


@pytest.mark.parametrize("distribution", ["beckmann", "gaussian"])
def test_the_material_of_very_many_copies_is_no_burden(distribution):
    material = CookTorrance(albedo=0.5, m=0.15, distribution=distribution)
    start = time.process_time()
    for _ in range(4000):
        material.pack()
    assert time.process_time() - start < 1.5
