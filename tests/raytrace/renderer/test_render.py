"""Pictures against arithmetic: worked examples, shadow edges where geometry puts them."""

import numpy as np
import pytest
from rendered import CAMERA, ONE, PLANE, box, grid, pixel, sphere, still_scene, white

from obscurance import ao
from obscurance.raytrace import BlinnPhong, Lambert, Mesh, Phong
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.lights.sources import AmbientLight, DirectionalLight, PointLight
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings


@pytest.fixture(scope="module")
def still():
    return still_scene()


PAINT = {"k_d": 0.3, "k_s": 0.6, "k_a": 0.3, "exponent": 3, "emission": 2}


@pytest.mark.parametrize(
    ("material", "viewer", "expected"),
    [
        (BlinnPhong(**PAINT), (0, 1, 1), 8.764768),
        (Phong(**PAINT), (0, 1, 1), 5.745584),
        (Phong(**PAINT), (-1, 1, 0), 12.045584),
    ],
)
def test_worked_example_a(material, viewer, expected):
    lights = (AmbientLight(intensity=1), DirectionalLight(direction=(-1, -1, 0), intensity=12))
    camera = Camera(tuple(3.0 * np.array(viewer)), (0, 0, 0), (0.1, 1, 0.2), field_of_view=0.01)
    frame = render(Scene((Object(Shape(PLANE, material)),), lights), camera, ONE)
    np.testing.assert_allclose(pixel(frame)[:3], expected, atol=1e-5)


@pytest.mark.parametrize(
    ("shading", "expected"), [("constant", 5.9), ("flat", 13.1), ("gouraud", 5.151757), ("phong", 11.790821)]
)
def test_worked_example_b(shading, expected):
    mesh = Mesh([[2, 2, 1], [6, 2, 1], [4, 5, 1]], [[0, 1, 2]], [[-1, -1, 1], [1, 0, 0], [0, 1, 1]])
    lights = (AmbientLight(intensity=1), DirectionalLight(direction=(0, 0, -1), intensity=12))
    scene = Scene((Object(Shape(mesh, BlinnPhong(**PAINT))),), lights)
    camera = Camera((4, 3, 5), (4, 3, 1), (0, 1, 0), height=1e-4)
    frame = render(scene, camera, Settings(width=1, height=1, samples=1, shading=shading, terminator=False))
    np.testing.assert_allclose(pixel(frame)[:3], expected, atol=1e-5)


def test_a_shadows_edge_lies_where_the_light_puts_it():
    """A half-plane at z = 1 over a floor, the light at (−1, 0, 3): the edge falls on x = ½."""
    floor, roof = grid((-4, -4, 0), (8, 0, 0), (0, 8, 0), 8), grid((-4, -4, 1), (4, 0, 0), (0, 8, 0), 8)
    scene = Scene((white(floor), white(roof)), (PointLight(position=(-1, 0, 3), intensity=10),))
    camera = Camera((0.5, 0.0, 9), (0.5, 0.0, 0), (0, 1, 0), height=0.5)
    frame = render(scene, camera, Settings(width=100, height=100, samples=1))
    x = 0.5 + (np.arange(100) + 0.5 - 50) / 100 * 0.5
    lit = frame.layers["shadow"][..., 0] > 0.5
    on_floor = x > 0.0 + 1e-9
    pixel_width = 0.5 / 100
    assert (lit[:, on_floor & (x > 0.5 + pixel_width)]).all()
    assert not (lit[:, on_floor & (x < 0.5 - pixel_width)]).any()
    dark = frame.layers["diffuse"][~lit]
    assert (dark == 0).all()


@pytest.mark.parametrize("reach", [2.0, None])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e5])
def test_a_floor_is_lit_by_the_photometry_law_as_far_as_the_light_s_range(scale, reach):
    """Times 1 − (d/range)⁴, and nothing beyond; at any scale of the scene."""
    floor = grid((-4 * scale, -4 * scale, 0), (8 * scale, 0, 0), (0, 8 * scale, 0), 8 * scale)
    light = PointLight(position=(0, 0, scale), intensity=scale**2, range=reach and reach * scale)
    camera = Camera((0, 0, 9 * scale), (0, 0, 0), (0, 1, 0), height=6 * scale)
    frame = render(Scene((white(floor),), (light,)), camera, Settings(width=64, height=64, samples=1))
    x = (np.arange(64) + 0.5 - 32) / 32 * 3
    squared = x[None, :] ** 2 + x[:, None] ** 2 + 1
    window = np.maximum(1 - (squared / (reach or np.inf) ** 2) ** 2, 0)
    np.testing.assert_allclose(
        frame.layers["beauty"][..., 0], 0.8 / np.pi / squared**1.5 * window, rtol=1e-4, atol=1e-6
    )
    assert frame.rays_skipped["unreached"] + frame.rays_skipped["culled"] == np.count_nonzero(window == 0)


def test_a_mirrored_object_is_lit_on_its_outside():
    mirror = np.diag([-1.0, 1, 1, 1])
    scene = Scene((Object(Shape(sphere(), Lambert(albedo=1)), mirror),), (DirectionalLight(direction=(0, 1, 0)),))
    frame = render(scene, Camera((0, -5, 0), (0, 0, 0), field_of_view=10), ONE)
    np.testing.assert_allclose(pixel(frame)[:3], 1 / np.pi, rtol=1e-2)
    np.testing.assert_allclose(pixel(frame, "normal"), [0, -1, 0], atol=0.05)


def test_obscurance_in_a_picture_is_the_bakers():
    mesh = box((0, 0, 0), (1, 1, 1), 0.25)
    floor = grid((-2, -2, -0.5), (4, 0, 0), (0, 4, 0), 0.25)
    scene = Scene((white(mesh), white(floor)))
    baked = ao.bake(scene.flattened(), samples=64)
    scene = scene.with_obscurance(baked.w)
    for vertex in (len(mesh.vertices) + 10, len(mesh.vertices) + 100, len(mesh.vertices) + 37):
        x, y, z = scene.flattened().vertices[vertex]
        camera = Camera((x + 1e-6, y + 1e-6, z + 3), (x + 1e-6, y + 1e-6, z), (0, 1, 0), height=1e-6)
        np.testing.assert_allclose(pixel(render(scene, camera, ONE), "obscurance"), baked.w[vertex], atol=1e-4)


def test_the_two_forms_weight_what_they_say(still):
    layers = {
        form: render(still, CAMERA, Settings(width=48, height=32, samples=1, obscurance=form)).layers
        for form in ("off", "ambient", "ambient and diffuse")
    }
    book = layers["ambient and diffuse"]  # the textbook's
    w = layers["off"]["obscurance"]
    hit = layers["off"]["object_id"][..., 0] > 0
    weighted = layers["off"]["ambient"] * w
    np.testing.assert_allclose(layers["ambient"]["ambient"][hit], weighted[hit], rtol=1e-5)
    np.testing.assert_array_equal(layers["ambient"]["diffuse"], layers["off"]["diffuse"])
    np.testing.assert_allclose(book["ambient"][hit], weighted[hit], rtol=1e-5)
    np.testing.assert_allclose(book["diffuse"][hit], (layers["off"]["diffuse"] * w)[hit], rtol=1e-5)
    np.testing.assert_array_equal(book["specular"], layers["off"]["specular"])


def test_a_lens_blurs_what_is_out_of_focus_only():
    edge = Object(Shape(grid((0, -5, 0), (5, 0, 0), (0, 10, 0), 10), Lambert(albedo=0, emission=1)))
    settings = Settings(width=64, height=8, samples=256)
    sharp, lens, far = (
        render(Scene((edge,)), Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 3.0, None, a, f), settings).layers["beauty"]
        for a, f in ((0.0, None), (0.3, None), (0.3, 2.0))
    )

    def width(image):
        return np.count_nonzero((image[4, :, 0] > 0.02) & (image[4, :, 0] < 0.98))

    assert width(sharp) <= 3
    assert width(lens) <= 3
    assert width(far) > 6


def test_progress_ends_at_the_end(still):
    calls = []
    render(still, CAMERA, Settings(width=40, height=40, samples=1), progress=lambda *done: calls.append(done))
    assert calls[-1] == (9, 9)
