"""Textures of glTF scenes: inside the file, beside it, and out of reach."""

import numpy as np
import pytest
from scene_files import UV, read, textured, triangle

from obscurance.raytrace.errors import MeshError


def test_texture_coordinates_point_upwards(tmp_path):
    builder = triangle()
    shape = read(tmp_path, builder, [{"mesh": 0}], **textured(builder, {"uri": "data:image/png;base64,QUJD"})).scene
    shape = shape.objects[0].shape
    assert shape.texture.data == b"ABC"
    assert shape.texture.srgb
    np.testing.assert_array_equal(shape.uv, [[0, 1], [1, 1], [0, 0]])


@pytest.mark.parametrize("kind", ["<u1", "<u2"])
def test_normalized_texture_coordinates(tmp_path, kind):
    builder = triangle()
    coordinates = (UV * np.iinfo(kind).max).astype(kind)
    fields = textured(builder, {"uri": "data:image/png;base64,QUJD"}, coordinates, normalized=True)
    shape = read(tmp_path, builder, [{"mesh": 0}], **fields).scene.objects[0].shape
    np.testing.assert_array_equal(shape.uv, [[0, 1], [1, 1], [0, 0]])


def test_an_image_inside_the_file_is_one_texture(tmp_path):
    builder = triangle()
    content = np.frombuffer(b"picture!", "<u1")
    view = builder.header["accessors"][builder.accessor(content, "SCALAR")]["bufferView"]
    fields = textured(builder, {"bufferView": view, "mimeType": "image/png"})
    first = builder.header["meshes"][0]["primitives"][0]
    builder.mesh({**first})
    one, other = read(tmp_path, builder, [{"mesh": 0}, {"mesh": 1}], **fields).scene.objects
    assert one.shape is not other.shape
    assert one.shape.texture is other.shape.texture
    assert one.shape.texture.data == b"picture!"


def test_wrap_modes_of_samplers(tmp_path):
    """Repetition by default, as glTF has it; one image by two samplers is two textures."""
    builder = triangle()
    fields = textured(builder, {"uri": "data:image/png;base64,QUJD"})
    for number in range(1, 4):
        builder.mesh({**builder.header["meshes"][0]["primitives"][0], "material": number})
    surface = fields["materials"][0]["pbrMetallicRoughness"]
    fields["materials"] = [
        {"pbrMetallicRoughness": {**surface, "baseColorTexture": {"index": n}}} for n in (0, 1, 2, 3)
    ]
    fields["samplers"] = [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9729}, {"wrapT": 33071}]
    fields["textures"] = [{"source": 0}, {"source": 0, "sampler": 0}, {"source": 0, "sampler": 1}, {"source": 0}]
    objects = read(tmp_path, builder, [{"mesh": n} for n in range(4)], **fields).scene.objects
    textures = [item.shape.texture for item in objects]
    assert [texture.wrap for texture in textures] == [
        ("repeat", "repeat"),
        ("clamp_to_edge", "mirrored_repeat"),
        ("repeat", "clamp_to_edge"),
        ("repeat", "repeat"),
    ]
    assert textures[0] is textures[3]


@pytest.mark.parametrize(
    ("sampler", "message"),
    [
        ({"wrapS": 1}, r"samplers\[0\]\.wrapS: expected 10497, 33648 or 33071, got 1"),
        ({"wrapT": "x"}, r"samplers\[0\]\.wrapT: expected 10497, 33648 or 33071"),
        (3, r"samplers\[0\]: expected an object"),
        (None, r"there is no samplers\[0\]"),
    ],
)
def test_hostile_samplers(tmp_path, sampler, message):
    builder = triangle()
    fields = textured(builder, {"uri": "data:image/png;base64,QUJD"})
    fields["textures"] = [{"source": 0, "sampler": 0}]
    with pytest.raises(MeshError, match=message):
        read(tmp_path, builder, [{"mesh": 0}], **fields, **({} if sampler is None else {"samplers": [sampler]}))


@pytest.mark.parametrize("name", ["a b.png", "a%20b.png"])
def test_an_image_beside_the_file(tmp_path, name):
    (tmp_path / name).write_bytes(b"picture")
    builder = triangle()
    description = read(tmp_path, builder, [{"mesh": 0}], **textured(builder, {"uri": "a%20b.png"}))
    shape = description.scene.objects[0].shape
    assert shape.texture.path == tmp_path / name
    assert shape.texture.data is None
    assert description.files == (tmp_path / "scene.glb", tmp_path / name)


@pytest.mark.parametrize("extension", ["KHR_texture_basisu", "EXT_texture_avif", "EXT_x", "none"])
def test_a_picture_in_a_format_that_is_not_read_is_left_out_in_a_line(tmp_path, extension):
    builder = triangle()
    fields = textured(builder, {"uri": "a.png"})
    fields["textures"] = [{"extensions": {extension: {"source": 0}}} if extension != "none" else {}]
    description = read(tmp_path, builder, [{"mesh": 0}], **fields)
    assert description.scene.objects[0].shape.texture is None
    line = f"textures[0]: expected a PNG, JPEG or WebP picture, got {extension}; the picture is left out"
    assert any(note.endswith(line) for note in description.notes)


def test_a_picture_as_webp_stands_in_where_there_is_no_png(tmp_path):
    for name in ("a.webp", "a.png"):
        (tmp_path / name).write_bytes(b"picture")
    for source, name in (({}, "a.webp"), ({"source": 1}, "a.png")):
        builder = triangle()
        fields = textured(builder, {"uri": "a.webp"})
        fields["images"] += [{"uri": "a.png"}]
        fields["textures"] = [source | {"extensions": {"EXT_texture_webp": {"source": 0}}}]
        shape = read(tmp_path, builder, [{"mesh": 0}], **fields).scene.objects[0].shape
        assert shape.texture.path == tmp_path / name


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("none.png", 'expected an existing file, got "none.png"'),
        ("../out.png", 'expected a path in the scene\'s folder or below, got "../out.png"'),
        ("%2e%2e/out.png", 'expected a path in the scene\'s folder or below, got "../out.png"'),
        ("https://x.y/out.png", "expected a path in the scene's folder or below"),
        ("data:image/png;base64,", "expected an image in base64"),
    ],
)
def test_images_out_of_reach(tmp_path, uri, message):
    (tmp_path / "out.png").write_bytes(b"picture")
    folder = tmp_path / "inside"
    folder.mkdir()
    builder = triangle()
    description = read(folder, builder, [{"mesh": 0}], **textured(builder, {"uri": uri}))
    assert description.scene.objects[0].shape.texture is None
    (line,) = (note for note in description.notes if "images" in note)
    assert f"scene.glb: images[0].uri: {message}" in line
    assert line.endswith("; the picture is left out")


def test_a_texture_without_coordinates_is_left_out(tmp_path):
    builder = triangle()
    fields = textured(builder, {"uri": "none.png"}, coordinates=None)
    assert read(tmp_path, builder, [{"mesh": 0}], **fields).scene.objects[0].shape.texture is None


def test_hostile_texture_coordinates(tmp_path):
    for change in ({"byteOffset": 10**6}, {"count": 10**6}, {"type": "SCALAR"}, {"componentType": 5124}):
        builder = triangle()
        fields = textured(builder, {"uri": "data:image/png;base64,QUJD"}, **change)
        with pytest.raises(MeshError, match=r"scene\.glb: TEXCOORD_0: expected two numbers a vertex, got "):
            read(tmp_path, builder, [{"mesh": 0}], **fields)
    builder = triangle()
    fields = textured(builder, {"uri": "data:image/png;base64,QUJD"}, np.full((3, 2), np.inf, "<f4"))
    with pytest.raises(MeshError, match=r"scene\.glb: TEXCOORD_0: expected finite numbers"):
        read(tmp_path, builder, [{"mesh": 0}], **fields)


def test_occlusion_textures_are_linear_and_have_coordinates_and_a_strength_of_their_own(tmp_path):
    builder = triangle()
    fields = textured(builder, {"uri": "data:image/png;base64,QUJD"})
    builder.header["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = builder.accessor(UV[::-1].copy(), "VEC2")
    fields["materials"][0]["occlusionTexture"] = {"index": 0, "texCoord": 1, "strength": 0.25}
    shape = read(tmp_path, builder, [{"mesh": 0}], **fields).scene.objects[0].shape
    assert shape.texture.srgb
    assert not shape.occlusion.texture.srgb
    assert shape.occlusion.strength == 0.25
    np.testing.assert_array_equal(shape.occlusion.uv, shape.uv[::-1])


@pytest.mark.parametrize(("strength", "meant"), [(-1, 0), (7, 1)])
def test_strengths_out_of_range_are_clipped(tmp_path, strength, meant):
    builder = triangle()
    fields = textured(builder, {"uri": "data:image/png;base64,QUJD"})
    fields["materials"][0]["occlusionTexture"] = {"index": 0, "strength": strength}
    assert read(tmp_path, builder, [{"mesh": 0}], **fields).scene.objects[0].shape.occlusion.strength == meant


def test_transformed_coordinates(tmp_path):
    """Scaled, then turned anticlockwise as the image is seen, then moved."""
    builder = triangle()
    fields = textured(builder, {"uri": "data:image/png;base64,QUJD"})
    moved = {"offset": [0.5, 0.25], "rotation": np.pi / 2, "scale": [2, 3]}
    fields["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = {"KHR_texture_transform": moved}
    shape = read(tmp_path, builder, [{"mesh": 0}], **fields).scene.objects[0].shape
    downwards = np.array([[0.5, 0.25], [0.5, 0.25 - 2], [0.5 + 3, 0.25]])
    np.testing.assert_allclose(shape.uv, np.stack([downwards[:, 0], 1 - downwards[:, 1]], axis=1), atol=1e-12)


@pytest.mark.parametrize("coordinates", [1, 0])
def test_the_extension_s_coordinates_go_first(tmp_path, coordinates):
    builder = triangle()
    fields = textured(builder, {"uri": "data:image/png;base64,QUJD"})
    builder.header["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = builder.accessor(0.5 * UV, "VEC2")
    reference = {"index": 0, "extensions": {"KHR_texture_transform": {"texCoord": coordinates}}}
    fields["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = reference
    shape = read(tmp_path, builder, [{"mesh": 0}], **fields).scene.objects[0].shape
    assert shape.uv[:, 0].max() == (0.5 if coordinates else 1)
