"""glTF scenes: objects, materials, textures, camera and lights as the specification means them."""

import base64
import io
from dataclasses import replace
from math import degrees, pi, sqrt

import numpy as np
import PIL.Image
import pytest
from gltf_files import QUAD, TRIANGLE, Builder
from scene_files import read, textured, triangle

from obscurance.raytrace import CookTorrance, Lambert
from obscurance.raytrace.brdf.reflect import reflect
from obscurance.raytrace.errors import InputError, MeshError, SceneError
from obscurance.raytrace.lights.sources import AmbientLight, DirectionalLight, PointLight
from obscurance.scenes.description.description import NEUTRAL
from obscurance.scenes.description.read import read_scene


def with_material(folder, material, **fields):
    builder = triangle(material=0)
    made = read(folder, builder, [{"mesh": 0}], materials=[material], **fields)
    return made.scene.objects[0].shape.material


def test_hierarchy_and_shared_shapes(tmp_path):
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, normals=np.tile([0, 0, 1.0], (3, 1))), builder.primitive(QUAD, [0, 1, 2]))
    nodes = [
        {"name": "a", "translation": [1, 0, 0], "children": [1], "mesh": 0},
        {"name": "b", "rotation": [0, 0, sqrt(0.5), sqrt(0.5)], "scale": [2, 2, 2], "children": [2]},
        {"name": "c", "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 3, 0, 1], "mesh": 0},
        {"name": "hidden", "scale": [0, 0, 0], "mesh": 0},
    ]
    objects = read(tmp_path, builder, nodes, roots=[0, 3]).scene.objects
    assert [item.name for item in objects] == ["a[0]", "a[1]", "c[0]", "c[1]"]
    assert objects[0].shape is objects[2].shape
    assert objects[1].shape is objects[3].shape
    np.testing.assert_allclose((objects[2].transform @ [1, 0, 0, 1])[:3], [-5, 2, 0], atol=1e-6)
    assert objects[0].shape.mesh.normals is not None
    assert objects[1].shape.mesh.normals is None


def test_without_camera_and_lights(tmp_path):
    made = read(tmp_path, triangle(), [{"mesh": 0}])
    assert made.camera.up == (0, 1, 0)
    assert [type(light) for light in made.scene.lights] == [DirectionalLight] * 3 + [AmbientLight]
    assert made.scene.objects[0].shape.material is NEUTRAL


def test_the_first_camera_in_the_tree(tmp_path):
    nodes = [
        {"mesh": 0, "children": [1]},
        {"translation": [0, 0, 5], "children": [2]},
        {"rotation": [0, sqrt(0.5), 0, sqrt(0.5)], "camera": 1},
        {"camera": 0},
    ]
    cameras = [
        {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 1}},
        {"type": "perspective", "perspective": {"yfov": 0.6, "znear": 0.1}},
    ]
    camera = read(tmp_path, triangle(), nodes, roots=[0, 3], cameras=cameras).camera
    assert camera.field_of_view == pytest.approx(degrees(0.6))
    right, above, forward = camera.axes()
    np.testing.assert_allclose(camera.position, [0, 0, 5])
    np.testing.assert_allclose([right, above, forward], [[0, 0, -1], [0, 1, 0], [-1, 0, 0]], atol=1e-12)
    camera = read(tmp_path, triangle(), nodes, roots=[3, 0], cameras=cameras).camera
    assert camera.height == 4


def test_a_bad_camera_is_named(tmp_path):
    cameras = [{"type": "perspective", "perspective": {"yfov": 4}}]
    with pytest.raises(SceneError, match=r"scene.glb: cameras\[0\].field_of_view: expected degrees"):
        read(tmp_path, triangle(), [{"mesh": 0}, {"camera": 0}], cameras=cameras)
    with pytest.raises(MeshError, match=r"scene.glb: content"):
        read(tmp_path, triangle(), [{"mesh": 0}, {"camera": 3}], cameras=cameras)


def test_matt_material(tmp_path):
    surface = {"baseColorFactor": [0.2, 0.4, 0.6, 1], "metallicFactor": 0}
    made = with_material(tmp_path, {"pbrMetallicRoughness": surface, "doubleSided": True})
    assert made == Lambert(albedo=(0.2, 0.4, 0.6), two_sided="viewer")
    assert with_material(tmp_path, {"name": "white"}) == Lambert(albedo=1.0)


@pytest.mark.parametrize("metallic", [0.0, 0.5, 1.0])
def test_reflectance_at_normal_incidence_is_gltfs(tmp_path, metallic):
    base, roughness = np.array([0.9, 0.5, 0.3]), 0.6
    surface = {"baseColorFactor": [*base, 1], "metallicFactor": metallic, "roughnessFactor": roughness}
    made = with_material(tmp_path, {"pbrMetallicRoughness": surface})
    assert isinstance(made, CookTorrance)
    assert made.m == pytest.approx(roughness**2)
    up = [0, 0, 1]
    black = replace(made, albedo=(0.0, 0.0, 0.0))
    m = roughness**2
    specular = 0.04 * (1 - metallic) + base * metallic
    np.testing.assert_allclose(reflect(black, up, up, up), specular / (4 * pi * m**2), rtol=1e-6)
    diffuse = reflect(made, up, up, up) - reflect(black, up, up, up)
    np.testing.assert_allclose(diffuse, 0.9 * (1 - metallic) * base / pi, rtol=1e-6)


def image(*colour):
    """An image of one colour as a data URI."""
    content = io.BytesIO()
    PIL.Image.new("RGBA" if len(colour) == 4 else "RGB", (4, 2), colour).save(content, "PNG")
    return {"uri": "data:image/png;base64," + base64.b64encode(content.getvalue()).decode()}


def with_textures(folder, material, *images):
    textures = [{"source": number} for number in range(len(images))]
    made = read(folder, triangle(material=0), [{"mesh": 0}], materials=[material], textures=textures, images=images)
    return made.scene.objects[0].shape.material, made.notes


def test_metallic_roughness_and_emissive_textures_count_by_their_means(tmp_path):
    surface = {"metallicFactor": 0.5, "roughnessFactor": 0.9, "metallicRoughnessTexture": {"index": 0}}
    material = {"pbrMetallicRoughness": surface, "emissiveFactor": [1, 0.5, 1], "emissiveTexture": {"index": 1}}
    material |= {"normalTexture": {"index": 0}, "extensions": {"KHR_materials_clearcoat": {}}}
    made, notes = with_textures(tmp_path, material, image(7, 102, 204), image(255, 188, 0))
    factors = {"metallicFactor": 0.5 * 0.8, "roughnessFactor": 0.9 * 0.4}
    expected = with_material(tmp_path, {"pbrMetallicRoughness": factors})
    assert made.m == pytest.approx(expected.m)
    assert made.k_s == pytest.approx(expected.k_s)
    np.testing.assert_allclose(made.emission, [1, 0.5 * ((188 / 255 + 0.055) / 1.055) ** 2.4, 0], rtol=1e-6)
    (note,) = notes
    assert note.endswith(
        "of emissiveTexture, metallicRoughnessTexture the mean; left out KHR_materials_clearcoat, normalTexture"
    )
    surface["metallicRoughnessTexture"]["index"] = 1
    made, (note,) = with_textures(tmp_path, {"pbrMetallicRoughness": surface}, image(1, 2, 3), {"uri": "gone.png"})
    assert made.k_s == pytest.approx(0.1)
    assert note.endswith("materials: left out metallicRoughnessTexture")


def test_specular_and_glossiness(tmp_path):
    given = {"diffuseFactor": [0.2, 0.4, 0.6, 1], "specularFactor": [0.04, 0.04, 0.04], "glossinessFactor": 0.4}
    extension = {"KHR_materials_pbrSpecularGlossiness": given}
    surface = {"baseColorFactor": [0.2, 0.4, 0.6, 1], "metallicFactor": 0, "roughnessFactor": 0.6}
    same = with_material(tmp_path, {"pbrMetallicRoughness": surface})
    assert np.allclose(with_material(tmp_path, {"extensions": extension}).pack().row, same.pack().row)
    given |= {
        "specularFactor": [1, 0.6, 0.2],
        "specularGlossinessTexture": {"index": 0},
        "diffuseTexture": {"index": 1},
    }
    made, (note,) = with_textures(tmp_path, {"extensions": extension}, image(188, 188, 188, 128), image(9, 9, 9))
    linear = ((188 / 255 + 0.055) / 1.055) ** 2.4
    assert made.m == pytest.approx((1 - 0.4 * 128 / 255) ** 2)
    up, metallic = [0, 0, 1], (linear - 0.04) / 0.96
    black = replace(made, albedo=(0.0, 0.0, 0.0))
    expected = linear * np.array([1, 0.6, 0.2]) / (4 * pi * made.m**2)
    np.testing.assert_allclose(reflect(black, up, up, up), expected, rtol=1e-6)
    assert made.k_s == pytest.approx(0.1 + 0.9 * metallic)
    assert note.endswith("of specularGlossinessTexture the mean")


def test_emission_unlit_and_transparent(tmp_path):
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 5}}
    glow = with_material(tmp_path, {"emissiveFactor": [1, 0.5, 0], "extensions": strength})
    assert glow.emission == (5, 2.5, 0)
    surface = {"baseColorFactor": [0.2, 0.4, 0.6, 0.25]}
    unlit = with_material(tmp_path, {"pbrMetallicRoughness": surface, "extensions": {"KHR_materials_unlit": {}}})
    assert unlit == Lambert(albedo=0.0, emission=(0.2, 0.4, 0.6))
    glass = with_material(tmp_path, {"pbrMetallicRoughness": surface, "alphaMode": "BLEND"})
    assert glass == with_material(tmp_path, {"pbrMetallicRoughness": surface})


def with_alpha(folder, material, colours=None):
    """The opacity of a textured triangle, whose image has alpha."""
    builder = triangle()
    fields = textured(builder, image(1, 2, 3, 4))
    surface = fields["materials"][0]["pbrMetallicRoughness"]
    fields["materials"][0] = {"pbrMetallicRoughness": surface | material.pop("surface", {})} | material
    if colours is not None:
        attributes = builder.header["meshes"][0]["primitives"][0]["attributes"]
        attributes["COLOR_0"] = builder.accessor(colours, f"VEC{colours.shape[1]}")
    return read(folder, builder, [{"mesh": 0}], **fields).scene.objects[0].shape.mesh.opacity


def test_alpha_is_the_factors_times_the_textures_times_the_vertices(tmp_path):
    surface = {"surface": {"baseColorFactor": [1, 1, 1, 0.4]}}
    assert with_alpha(tmp_path, {**surface}) is None
    blended = with_alpha(tmp_path, {**surface, "alphaMode": "BLEND"})
    (alpha,) = blended.surfaces
    assert (alpha.factor, alpha.cutoff, alpha.grey) == (0.4, None, False)
    assert alpha.texture.data.startswith(b"\x89PNG")
    np.testing.assert_array_equal(blended.uv, [[[0, 1], [1, 1], [0, 0]]])
    assert blended.corners is None
    assert with_alpha(tmp_path, {"alphaMode": "MASK"}).surfaces[0].cutoff == 0.5
    rows = np.array([[0, 0, 0, 0.25], [1, 1, 1, 0.5], [0, 0, 0, 1]], "<f4")
    masked = with_alpha(tmp_path, {"alphaMode": "MASK", "alphaCutoff": 0.1}, rows)
    assert masked.surfaces[0].cutoff == 0.1
    np.testing.assert_array_equal(masked.corners, [[0.25, 0.5, 1]])
    assert with_alpha(tmp_path, {"alphaMode": "BLEND"}, rows[:, :3].copy()).corners is None
    given = {"diffuseFactor": [1, 1, 1, 0.3]}
    glossy = with_alpha(tmp_path, {"alphaMode": "BLEND", "extensions": {"KHR_materials_pbrSpecularGlossiness": given}})
    assert (glossy.surfaces[0].factor, glossy.surfaces[0].texture) == (0.3, None)


@pytest.mark.parametrize("key", ["materials", "textures", "images", "cameras", "extensions"])
@pytest.mark.parametrize("value", [[], [3], 3, {}, None])
def test_malformed_headers_are_one_line(tmp_path, key, value):
    builder = triangle()
    fields = textured(builder, {"uri": "data:image/png;base64,QUJD"})
    fields["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1}}]
    fields["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    nodes = [{"mesh": 0}, {"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}]
    assert read(tmp_path, builder, nodes, **fields).scene.lights == (PointLight(position=(0, 0, 0)),)
    with pytest.raises(InputError) as caught:
        read(tmp_path, builder, nodes, **fields | {key: value})
    assert "\n" not in str(caught.value)


def test_a_gltf_in_a_toml_scene_keeps_its_materials_unless_others_are_given(tmp_path):
    builder = triangle()
    fields = textured(builder, {"uri": "data:image/png;base64,QUJD"})
    nodes = [{"mesh": 0, "translation": [1, 0, 0], "name": "x"}, {"mesh": 0}]
    (tmp_path / "it.glb").write_bytes(builder.glb(nodes, **fields))
    entry = '[[objects]]\nmesh = "it.glb"\nscale = 2\n'
    text = entry + "copies = [{ translate = [0, 5, 0] }, {}]\n" + entry + 'material = "gold"\nname = "bar"\n'
    (tmp_path / "scene.toml").write_text(text)
    objects = read_scene(tmp_path / "scene.toml").scene.objects
    assert [item.name for item in objects] == ["x 0", "node 1 0", "x 1", "node 1 1", "bar x", "bar node 1"]
    assert len({id(item.shape) for item in objects}) == 2
    assert objects[0].shape.texture.data == b"ABC"
    np.testing.assert_allclose((objects[0].transform @ [1, 1, 1, 1])[:3], [4, 7, 2])
    assert objects[4].shape.texture is None
    assert objects[4].shape.material.model == "cook_torrance"
    assert objects[4].shape.mesh is objects[0].shape.mesh
