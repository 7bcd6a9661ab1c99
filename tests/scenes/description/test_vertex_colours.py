"""Colours of vertices in pictures: glTF's are linear, those of OBJ and PLY are taken as sRGB."""

import numpy as np
import pytest
from gltf_files import QUAD, Builder
from mesh_files import obj
from scene_files import read

from obscurance import ao, scenes
from obscurance.raytrace import AmbientLight, Camera, Lambert, OptionError, Scene, Settings, Shape, render
from obscurance.raytrace.errors import SceneError
from obscurance.raytrace.image.colour import decode_srgb
from obscurance.scenes.description.description import NEUTRAL
from obscurance.scenes.description.read import read_scene

FACES = np.array([[0, 1, 2], [0, 2, 3]])
COLOURS = np.array([[1, 0, 1], [0.5, 0.25, 0], [0, 1, 0.2], [0.8, 0.8, 0.8]])
AHEAD = Camera(position=(0.5, 0.5, 3), target=(0.5, 0.5, 0), up=(0, 1, 0), height=1.0)


COLOURED = obj(np.column_stack([QUAD, COLOURS]), FACES)


def ply():
    header = "ply\nformat ascii 1.0\nelement vertex 4\n"
    header += "".join(f"property float {name}\n" for name in "xyz")
    header += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    header += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [[*place, *colour] for place, colour in zip(QUAD, np.rint(255 * COLOURS).astype(int), strict=True)]
    rows += [[3, *face] for face in FACES]
    return (header + "\n".join(" ".join(map(str, row)) for row in rows)).encode()


def gltf(folder, kind="<f4", scale=1, **fields):
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, FACES))
    stored = np.rint(COLOURS * scale).astype(kind) if scale != 1 else COLOURS.astype(kind)
    stored = np.concatenate([stored, np.full((4, 1), scale, kind)], axis=1)
    attributes = builder.header["meshes"][0]["primitives"][0]["attributes"]
    attributes["COLOR_0"] = builder.accessor(np.ascontiguousarray(stored), "VEC4", **fields)
    return read(folder, builder, [{"mesh": 0}]).scene


def only_shape(scene):
    (item,) = scene.objects
    return item.shape


@pytest.mark.parametrize(("kind", "scale"), [("<f4", 1), ("<u1", 255), ("<u2", 65535)])
def test_those_of_gltf_are_linear(tmp_path, kind, scale):
    shape = only_shape(gltf(tmp_path, kind, scale, **({"normalized": True} if scale > 1 else {})))
    np.testing.assert_allclose(shape.colours, COLOURS, atol=0.51 / scale if scale > 1 else 1e-7)
    assert shape.material == Lambert(albedo=1.0)


@pytest.mark.parametrize("ending", ["obj", "ply"])
def test_those_of_obj_and_ply_are_srgb(tmp_path, ending):
    path = tmp_path / f"quad.{ending}"
    path.write_bytes(COLOURED if ending == "obj" else ply())
    shape = only_shape(read_scene(path).scene)
    np.testing.assert_allclose(shape.colours, decode_srgb(COLOURS), atol=3e-3)
    assert shape.material == Lambert(albedo=1.0)


@pytest.mark.parametrize("shading", ["constant", "flat", "gouraud", "phong", "quadratic"])
def test_they_multiply_the_albedo_linear_between_vertices(tmp_path, shading):
    scene = Scene(gltf(tmp_path).objects, (AmbientLight(intensity=(0.5, 0.5, 0.5)),))
    layers = render(scene, AHEAD, Settings(32, 32, samples=1, shading=shading, obscurance="off")).layers
    x, y = np.meshgrid((np.arange(32) + 0.5) / 32, 1 - (np.arange(32) + 0.5) / 32)
    a, b, c, d = COLOURS
    lower = (1 - x)[..., None] * a + (x - y)[..., None] * b + y[..., None] * c
    upper = (1 - y)[..., None] * a + x[..., None] * c + (y - x)[..., None] * d
    expected = np.where((x >= y)[..., None], lower, upper)
    np.testing.assert_allclose(layers["albedo"], expected, atol=2e-6)
    np.testing.assert_allclose(layers["beauty"][..., :3], 0.5 * expected, atol=2e-6)


@pytest.mark.parametrize("ending", [".ply", ".glb"])
def test_the_grey_that_a_bake_writes_is_no_colour(tmp_path, ending):
    (tmp_path / "quad.obj").write_bytes(obj(np.column_stack([QUAD, np.ones((4, 3))]), FACES))
    made = scenes.load(tmp_path / "quad.obj")
    bake = ao.bake(made.mesh, samples=16)
    scenes.write(tmp_path / f"baked{ending}", bake, made, colors="rgb")
    shape = only_shape(read_scene(tmp_path / f"baked{ending}").scene)
    assert shape.colours is None


def test_a_material_in_a_scene_takes_their_place_unless_the_scene_says_otherwise(tmp_path):
    (tmp_path / "quad.obj").write_bytes(COLOURED)

    def read_with(*lines):
        (tmp_path / "scene.toml").write_text("\n".join(["[[objects]]", *lines]))
        return read_scene(tmp_path / "scene.toml").scene

    mesh, clay = 'mesh = "quad.obj"', 'material = "clay"'
    np.testing.assert_allclose(only_shape(read_with(mesh)).colours, decode_srgb(COLOURS), atol=1e-6)
    assert only_shape(read_with(mesh, clay)).colours is None
    assert only_shape(read_with(mesh, "vertex_colors = false")).material == NEUTRAL
    assert only_shape(read_with(mesh, clay, "vertex_colors = true")).colours is not None
    with pytest.raises(
        SceneError, match=r"objects\[0\].vertex_colors: expected a mesh with colours of vertices, got one"
    ):
        read_with('builtin = "box"', "vertex_colors = true")


def test_colours_that_some_vertices_lack_are_left_out_with_a_warning(tmp_path):
    (tmp_path / "quad.obj").write_bytes(COLOURED.replace(b"v 1.0 1.0 0.0 0.0 1.0 0.2", b"v 1.0 1.0 0.0"))
    read = read_scene(tmp_path / "quad.obj")
    assert only_shape(read.scene).colours is None
    assert "colours, which some vertices lack" in read.notes[0]


@pytest.mark.parametrize("bad", [np.ones((3, 3)), np.full((4, 3), 1.5), np.full((4, 3), np.nan), "red"])
def test_colours_that_are_none_are_refused(tmp_path, bad):
    with pytest.raises(OptionError, match="colours: expected"):
        Shape(only_shape(gltf(tmp_path)).mesh, Lambert(albedo=1.0), colours=bad)


def test_a_mesh_alone_without_normals_is_split_at_creases_with_its_colours(tmp_path):
    """A roof whose ridge is a crease, and one whose ridge is none."""
    for height, count in ((1, 8), (0.2, 6)):
        places = [(0, -1, 0), (0, 1, 0), (-1, 1, -height), (-1, -1, -height), (1, -1, -height), (1, 1, -height)]
        lines = ["v {} {} {} {} 0 1".format(*place, k / 5) for k, place in enumerate(places)]
        (tmp_path / "roof.obj").write_text("\n".join([*lines, "f 1 2 3 4", "f 1 5 6 2", ""]))
        described = read_scene(tmp_path / "roof.obj")
        shape, (of, total) = described.scene.objects[0].shape, described.file_vertices()
        assert len(shape.mesh.vertices) == len(shape.colours) == count
        assert total == 6
        np.testing.assert_array_equal(shape.mesh.vertices, np.array(places, float)[of])
        np.testing.assert_array_equal(shape.colours, shape.colours[of])
        if count == 6:  # shaded with those that every mesh without has
            assert shape.mesh.normals is None
        else:
            ridge = shape.mesh.normals[of == 0]
            leaning = np.array([[-height, 0, 1], [height, 0, 1]]) / np.hypot(1, height)
            np.testing.assert_allclose(ridge[np.argsort(ridge[:, 0])], leaning, atol=1e-6)
