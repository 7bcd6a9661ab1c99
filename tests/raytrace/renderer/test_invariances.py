"""Invariances of a picture: threads, crops, layers, skipping, instances, units, what nobody sees."""

import weakref
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from rendered import CAMERA, SMALL, grid, sphere, still_scene, white

from obscurance import ao
from obscurance.raytrace import Mesh, Phong
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.image.formats import LAYERS
from obscurance.raytrace.lights.sources import DirectionalLight, PointLight, SpotLight
from obscurance.raytrace.renderer.render import render, seen_vertices
from obscurance.raytrace.renderer.render_scene import build, release
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings


@pytest.fixture(scope="module")
def still():
    return still_scene()


@pytest.fixture(scope="module")
def picture(still):
    return render(still, CAMERA, SMALL)


def test_the_layers_add_up_exactly(picture):
    parts = picture.layers
    total = ((parts["ambient"] + parts["diffuse"]) + parts["specular"]) + parts["emission"]
    np.testing.assert_array_equal(parts["beauty"][..., :3], total)
    assert {name: layer.shape[2] for name, layer in parts.items()} == LAYERS


def test_nothing_is_negative_or_undefined(picture):
    for name, layer in picture.layers.items():
        assert not np.isnan(layer).any(), name
        if name != "normal":
            assert (layer >= 0).all(), name
    miss = picture.layers["object_id"][..., 0] == 0
    assert np.isinf(picture.layers["depth"][miss]).all()
    empty = picture.layers["beauty"][..., 3] == 0
    np.testing.assert_allclose(picture.layers["beauty"][empty][:, :3], np.tile([0.1, 0.2, 0.3], (empty.sum(), 1)))


@pytest.mark.parametrize("threads", [1, 3])
def test_the_picture_does_not_depend_on_threads(still, picture, threads):
    again = render(still, CAMERA, SMALL, threads=threads)
    for name, layer in picture.layers.items():
        np.testing.assert_array_equal(again.layers[name], layer)
    assert again.rays == picture.rays
    assert again.rays_skipped == picture.rays_skipped


@pytest.mark.parametrize("crop", [(20, 8, 33, 29), (0, 0, 1, 1), (95, 63, 1, 1), (37, 21, 7, 3)])
def test_a_crop_is_a_part_of_the_whole(still, picture, crop):
    again = render(still, CAMERA, Settings(width=96, height=64, samples=16, crop=crop))
    x, y, width, height = crop
    for name, layer in picture.layers.items():
        np.testing.assert_array_equal(again.layers[name], layer[y : y + height, x : x + width])


def test_beauty_alone_is_the_same_beauty(still, picture):
    again = render(still, CAMERA, SMALL, layers=False)
    assert set(again.layers) == {"beauty"}
    np.testing.assert_array_equal(again.layers["beauty"], picture.layers["beauty"])


def test_every_ray_is_traced_or_accounted_for(still):
    frame = render(still, CAMERA, Settings(width=96, height=64, samples=1))
    skipped = frame.rays_skipped
    assert frame.rays["primary"] == 96 * 64
    assert frame.rays["shadow"] + sum(skipped.values()) == 3 * 96 * 64


def test_pixels_that_agree_are_retired_and_the_others_go_on(still, picture):
    twice = picture.rays["primary"] + picture.rays_skipped["primary_agreed"] - 16 * 96 * 64
    assert twice % 4 == 0  # the first samples of pixels that a neighbour in another tile has recalled
    assert 0 <= twice < 0.01 * picture.rays["primary"]
    assert 0.3 < picture.rays_skipped["primary_agreed"] / (12 * 96 * 64) < 1
    many = render(still, CAMERA, Settings(width=96, height=64, samples=256)).layers["beauty"]
    few = render(still, CAMERA, Settings(width=96, height=64, samples=4)).layers["beauty"]
    error = [np.sqrt(np.mean((layer - many) ** 2)) for layer in (picture.layers["beauty"], few)]
    assert error[0] < 0.6 * error[1]


def test_skipping_changes_nothing(still):
    """Black, distant and unseen lights added to a scene leave every bit of the picture as it was."""
    more = (
        PointLight(position=(0, 0, 3), intensity=0),
        SpotLight(position=(0, 0, 9), direction=(0, 0, 1), half_angle=11.5, intensity=99),
        DirectionalLight(direction=(0, 0, 1), intensity=0),
    )
    settings = Settings(width=48, height=32, samples=1)
    before = render(still, CAMERA, settings)
    after = render(Scene(still.objects, still.lights + more, still.background), CAMERA, settings)
    np.testing.assert_array_equal(after.layers["beauty"], before.layers["beauty"])
    assert after.rays == before.rays


def test_instances_look_like_copies():
    ball = sphere(subdivisions=3)
    turn = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))
    places = [
        trimesh.transformations.translation_matrix((x, 0, 0)) @ turn @ np.diag([1, 1, 0.5 + abs(x) / 4, 1])
        for x in (-2.5, 0, 2.5)
    ]
    material = Phong(k_d=0.4, k_s=0.5)
    shared = Shape(ball, material)
    instances = tuple(Object(shared, place) for place in places)
    copies = tuple(Object(Shape(ball, material), place) for place in places)
    lights = (PointLight(position=(3, -4, 5), intensity=40),)
    settings = Settings(width=120, height=60, samples=1)
    a, b = (render(Scene(objects, lights), CAMERA, settings).layers for objects in (instances, copies))
    same = a["object_id"] == b["object_id"]
    assert same.mean() > 0.999
    far = np.abs(a["beauty"] - b["beauty"]).max(axis=2) > 1e-3
    assert far.mean() < 0.003


@pytest.mark.parametrize("shading", ["phong", "gouraud"])
def test_vertices_that_no_pixel_sees_need_no_obscurance(still, shading):
    settings = Settings(width=48, height=32, samples=4, shading=shading)
    mesh = still.flattened()
    seen = seen_vertices(still, CAMERA, settings)
    assert 0.2 < seen.mean() < 0.8
    whole, part = (ao.bake(mesh, samples=16, only=only, denoise=False).w for only in (None, seen))
    a, b = (render(still.with_obscurance(w), CAMERA, settings).layers for w in (whole, part))
    for name, layer in a.items():
        np.testing.assert_array_equal(b[name], layer)


def test_geometry_is_built_once_for_seen_vertices_and_pictures_with_any_w(still):
    scene = Scene(tuple(Object(replace(item.shape), item.transform) for item in still.objects), still.lights)
    seen = seen_vertices(scene, CAMERA, SMALL)
    first = weakref.ref(build(scene).geometry.embree)
    baked = scene.with_obscurance(np.where(seen, 0.5, 1.0))
    darker = Scene(baked.objects, still.lights[:1])
    open_, *others = (render(each, CAMERA, SMALL).layers["obscurance"].min() for each in (scene, baked, darker))
    assert (open_, *others) == (1, 0.5, 0.5)
    assert all(build(each).geometry.embree is first() for each in (scene, baked, darker))
    render(scene, CAMERA, replace(SMALL, normals="area"))
    other = weakref.ref(build(scene, "area").geometry.embree)
    assert other() is not first()
    release(scene)
    assert other() is None
    assert first() is not None
    del scene, baked, darker
    assert first() is None


@pytest.mark.parametrize("size", [1e-30, 1e-3, 1e25])
@pytest.mark.parametrize("attenuation", [(0, 0, 1), (0, 1, 0), (1, 0, 0)])
def test_the_picture_does_not_depend_on_the_unit_of_length(size, attenuation):
    """Also where squares of lengths are beyond float32."""

    def seen(unit):
        shapes = grid((-4, -4, 0), (8, 0, 0), (0, 8, 0), 8), sphere(subdivisions=3)
        objects = tuple(white(Mesh(mesh.vertices * unit, mesh.faces)) for mesh in shapes)
        power = unit ** float(np.dot(attenuation, (0, 1, 2)))
        place = tuple(unit * np.array([2.0, -3.0, 4.0]))
        lamp = PointLight(position=place, intensity=30 * power, attenuation=attenuation, range=20 * unit)
        camera = Camera(tuple(unit * np.array([3.0, -6.0, 3.0])), (0, 0, 0))
        return render(Scene(objects, (lamp,)), camera, Settings(width=48, height=32, samples=1)).layers["beauty"]

    expected = seen(1.0)
    assert expected[..., :3].max() > 0.1
    off = np.abs(seen(size) - expected).max(axis=2) > 1e-5 * expected.max()
    assert off.mean() < 0.005  # pixels on an edge


def test_another_view_of_a_scene_needs_no_building_and_nobody_can_change_what_was_built(still):
    assert build(still) is build(still)
    assert build(Scene(still.objects, still.lights)) is not build(still)
    for array in (still.objects[0].transform, still.objects[0].w):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0
