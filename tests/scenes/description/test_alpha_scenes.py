"""Alpha of objects in TOML scenes, and `render --alpha`."""

import numpy as np
import PIL.Image
import pytest
from command import refused_without_a_trace, succeeded
from scene_files import textured, triangle

from obscurance.raytrace.errors import InputError
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.description.read import read_scene

PLANE = '[[objects]]\nbuiltin = "plane"\n'


def write(folder, *lines):
    (folder / "scene.toml").write_text("\n".join(lines))
    return folder / "scene.toml"


def opacity(folder, *lines):
    (folder / "leaf.png").touch()
    return read_scene(write(folder, *lines)).scene.objects[0].shape.mesh.opacity


def test_opacity_texture_and_cutoff(tmp_path):
    (alpha,) = opacity(tmp_path, PLANE, "opacity = 0.4").surfaces
    assert (alpha.factor, alpha.texture, alpha.cutoff) == (0.4, None, None)
    made = opacity(tmp_path, PLANE, 'opacity_texture = "leaf.png"', "cutoff = 0.3", 'wrap = "clamp_to_edge"')
    (alpha,) = made.surfaces
    assert (alpha.factor, alpha.cutoff, alpha.grey) == (1.0, 0.3, True)
    assert alpha.texture.wrap == ("clamp_to_edge",) * 2
    assert made.uv.shape == (len(made.of), 3, 2)
    assert opacity(tmp_path, PLANE) is None


def test_a_material_of_the_entry_takes_the_place_of_the_files_alpha_and_opacity_does_too(tmp_path):
    builder = triangle()
    fields = textured(builder, {"uri": "leaf.png"})
    fields["materials"][0]["alphaMode"] = "MASK"
    (tmp_path / "leaf.png").touch()
    (tmp_path / "it.glb").write_bytes(builder.glb([{"mesh": 0}], **fields))
    entry = '[[objects]]\nmesh = "it.glb"\n'
    assert opacity(tmp_path, entry).surfaces[0].cutoff == 0.5
    assert opacity(tmp_path, entry, 'material = "clay"') is None
    assert opacity(tmp_path, entry, "opacity = 0.1").surfaces[0].factor == 0.1


@pytest.mark.parametrize("lines", [[], ['texture = "leaf.png"']])
def test_an_obj_has_the_alpha_of_its_materials_with_and_without_a_texture(tmp_path, lines):
    (tmp_path / "it.mtl").write_text("newmtl leaf\nd 0.25\n")
    text = "mtllib it.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl leaf\nf 1/1 2/2 3/3\n"
    (tmp_path / "it.obj").write_text(text)
    assert opacity(tmp_path, '[[objects]]\nmesh = "it.obj"', *lines).surfaces[0].factor == 0.25


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["opacity = nan"], "opacity: expected"),
        (["opacity = 1.5"], "opacity: expected"),
        (["opacity = -0.5"], "opacity: expected"),
        (['opacity = "half"'], "opacity: expected"),
        (["opacity = 0.5", "cutoff = 2"], "cutoff: expected"),
        (["cutoff = 0.5"], "cutoff: expected opacity or opacity_texture with it"),
        (['opacity_texture = "../leaf.png"'], "opacity_texture: expected"),
        (["opacity_texture = 3"], "opacity_texture: expected"),
    ],
)
def test_mistakes_are_one_line(tmp_path, lines, message):
    with pytest.raises(InputError, match=message) as error:
        read_scene(write(tmp_path, PLANE, *lines))
    assert "\n" not in str(error.value)
    assert "objects[0]." in str(error.value)


def test_a_mesh_without_texture_coordinates_takes_no_opacity_texture(tmp_path):
    (tmp_path / "leaf.png").touch()
    (tmp_path / "it.stl").write_bytes(stl())
    with pytest.raises(InputError, match="opacity_texture: expected a mesh with texture coordinates, got one without"):
        read_scene(write(tmp_path, '[[objects]]\nmesh = "it.stl"\nopacity_texture = "leaf.png"'))


def stl():
    import trimesh

    return trimesh.creation.box().export(file_type="stl")


def test_the_command_cuts_by_a_texture_of_any_size_unless_alpha_is_to_be_ignored(tmp_path):
    codes = np.zeros((6, 10, 4), np.uint8)
    codes[..., 3] = np.where(np.arange(10) < 5, 255, 0)
    PIL.Image.fromarray(codes).save(tmp_path / "leaf.png")
    scene = write(
        tmp_path,
        "background = [1, 0, 0]\n[camera]\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\nup = [0, 1, 0]\nheight = 1.0",
        "[render]\nwidth = 16\nheight = 16\nsamples = 1\n[obscurance]\nsamples = 16",
        PLANE,
        'opacity_texture = "leaf.png"\ncutoff = 0.5\nwrap = "clamp_to_edge"',
        '[[lights]]\nlight = "ambient"\nintensity = 1',
    )
    grey, red = [0.7, 0.7, 0.7, 1], [1, 0, 0, 0]
    for options, right in (([], red), (["--alpha", "ignore"], grey)):
        succeeded("render", scene, "-o", tmp_path / "out.exr", *options)
        layers, _ = read_image(tmp_path / "out.exr")
        np.testing.assert_allclose(layers["beauty"][:, 0], [grey] * 16, atol=1e-6)
        np.testing.assert_allclose(layers["beauty"][:, 15], [right] * 16, atol=1e-6)
    for content, message in (
        (b"no image", "leaf.png: content: expected an image"),
        (None, "expected an existing file"),
    ):
        (tmp_path / "leaf.png").unlink() if content is None else (tmp_path / "leaf.png").write_bytes(content)
        refused_without_a_trace(tmp_path, [message], "render", scene, "-o", tmp_path / "gone.png")
