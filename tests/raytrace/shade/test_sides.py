"""Sides of surfaces: the one that reflects, the light it sees, and what shows through it."""

import numpy as np
import pytest
from rendered import PLANE, grid, pixel, sphere, white

from obscurance.raytrace import Lambert, Mesh, OrenNayar, Phong, Strauss
from obscurance.raytrace.brdf.reflect import reflect
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.lights.sources import AmbientLight, DirectionalLight, PointLight
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings
from obscurance.scenes.geometry.polyhedra import generic_rotation

SIDES = (False, True, "viewer")
SHADINGS = ("constant", "flat", "gouraud", "phong", "quadratic")


def seen_from(side, light_from, material, **settings):
    """The light (3,) of a sheet in y = 0 whose normal is y: eye and sun at y = ±."""
    sun = DirectionalLight(direction=(0.2, -light_from, 0.1))
    camera = Camera((0, 5.0 * side, 0.1), (0, 0, 0.1), (1, 0, 0))
    scene = Scene((Object(Shape(PLANE, material)),), (sun,))
    return pixel(render(scene, camera, Settings(width=1, height=1, samples=1, **settings)))[:3]


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("shadows", [True, False])
@pytest.mark.parametrize(("side", "light_from"), [(-1, -1), (-1, 1), (1, -1), (1, 1)])
@pytest.mark.parametrize("two_sided", SIDES)
def test_a_sheet_is_lit_as_its_model_says(two_sided, side, light_from, shadows, shading):
    """|n·l| from either side with `true`: the sheet does not shade itself."""
    material = Lambert(albedo=1, two_sided=two_sided)
    expected = reflect(material, [0, 1, 0], [-0.2, light_from, -0.1], [0, side, 0])
    if not two_sided and side < 0:
        expected = np.zeros(3)  # the back of a one-sided surface reflects no lamp
    found = seen_from(side, light_from, material, shading=shading, shadows=shadows)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
def test_what_stands_behind_a_sheet_shades_it(shading):
    """A ball between the lamp behind and the sheet; none between the sheet and the viewer."""
    camera = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), height=3)
    sheet = grid((-3, -3, 0), (6, 0, 0), (0, 6, 0), 0.1)
    lamp = PointLight(position=(0, 0, -4), intensity=30)
    settings = Settings(width=60, height=60, samples=1, shading=shading)
    objects = white(sheet, two_sided=True), white(sphere(0.4, (0, 0, -1.5)))
    picture = render(Scene(objects, (lamp,)), camera, settings).layers["diffuse"][..., 0]
    x = (np.arange(60) + 0.5 - 30) / 20
    radius = np.hypot(x[:, None], x[None, :])
    edge = 4 * np.tan(np.arcsin(0.4 / 2.5))
    assert (picture[radius < edge - 0.15] == 0).all()
    assert (picture[radius > edge + 0.15] > 0).all()


@pytest.mark.parametrize("turn", range(3))
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_a_sheet_neither_shades_itself_nor_leaks(scale, turn):
    """Lamps on either side of a smooth ball's shell: from outside all of the near half is lit by the lamp outside, and
    of the one inside by all.
    """
    turned = np.eye(4)
    turned[:3, :3] = scale * generic_rotation(turn).as_matrix()
    turned[:3, 3] = scale * np.array([3.0, -2.0, 1.0])
    ball = Object(Shape(sphere(subdivisions=3), Lambert(albedo=0.8, two_sided=True)), turned)
    centre = turned[:3, 3]
    camera = Camera(tuple(centre + scale * np.array([0, -6, 0])), tuple(centre), height=1.9 * scale)
    lamp = PointLight(position=tuple(centre + scale * np.array([0.1, 0.2, 0.1])), intensity=scale**2)
    frame = render(Scene((ball,), (lamp,)), camera, Settings(width=64, height=64, samples=1))
    hit = frame.layers["object_id"][..., 0] > 0
    assert hit.sum() > 2000
    assert (frame.layers["shadow"][hit] == 1).all()
    assert (frame.layers["diffuse"][hit] > 0).all()
    behind = PointLight(position=tuple(centre + scale * np.array([0.0, 30, 0])), intensity=scale**2)
    frame = render(Scene((ball,), (behind,)), camera, Settings(width=64, height=64, samples=1))
    near = hit & (-frame.layers["normal"][..., 1] > 0.2)
    assert not frame.layers["diffuse"][near].any()  # its far half hides the lamp from the near one


@pytest.mark.parametrize("shading", ["flat", "gouraud", "phong"])
def test_light_from_behind_is_culled_only_where_nothing_hides_it(shading):
    """As with every shadow ray traced, where two specks far off are one object: its box is in the way of all light."""
    objects = (
        white(Mesh([[-3, -3, 0], [3, -3, 0], [0, 4, 0]], [[0, 1, 2]]), two_sided=True),
        white(sphere(0.5, (0.3, 0.2, -1.5), 2), two_sided=True),
        white(sphere(0.4, (-0.6, -0.2, 1.0), 2)),
    )
    lights = PointLight(position=(0, 0, -4), intensity=30), DirectionalLight(direction=(0.4, 0.1, 1))
    corners = np.array([[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0]])
    specks = np.concatenate([corners - 60, corners + 60]), np.arange(6).reshape(2, 3)
    apart = tuple(white(Mesh(specks[0][3 * k : 3 * k + 3], [[0, 1, 2]])) for k in range(2))
    camera, settings = Camera((1, -6, 5), (0, 0, 0)), Settings(width=90, height=60, samples=4, shading=shading)
    frame = render(Scene((*objects, *apart), lights), camera, settings)
    whole = render(Scene((*objects, white(Mesh(*specks))), lights), camera, settings)
    assert whole.rays_skipped["unobstructed"] == 0
    assert (frame.rays_skipped["unobstructed"] > 0) == (shading == "gouraud")  # others' points are behind or hidden
    for name, layer in whole.layers.items():
        np.testing.assert_array_equal(frame.layers[name], layer)


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("samples", [1, 16])
def test_the_background_shows_through_what_is_transparent(shading, samples):
    glass = Strauss(colour=(0.9, 0.4, 0.1), smoothness=0.3, transparency=0.75)
    camera = Camera((0, -5, 0.1), (0, 0, 0.1), (1, 0, 0))
    settings = Settings(width=2, height=2, samples=samples, shading=shading)
    objects, lights = (Object(Shape(PLANE, glass)),), (AmbientLight(intensity=0.5),)
    black, blue = (render(Scene(objects, lights, colour), camera, settings) for colour in ((0, 0, 0), (0.1, 0.2, 0.8)))
    for name in ("beauty", "emission"):
        shown = blue.layers[name][..., :3] - black.layers[name][..., :3]
        np.testing.assert_allclose(shown, np.broadcast_to([0.075, 0.15, 0.6], (2, 2, 3)), rtol=1e-5)
    np.testing.assert_array_equal(blue.layers["beauty"][..., 3], np.float32(0.25))
    assert blue.background == (0.1, 0.2, 0.8)
    assert black.layers["beauty"][..., :3].any()


@pytest.mark.parametrize("material", [Phong(k_d=0.4, k_s=0.6, exponent=5), OrenNayar(albedo=0.7, sigma=0.5)])
@pytest.mark.parametrize("shading", ["constant", "flat"])
def test_a_face_has_one_colour(shading, material):
    """Also with a lamp and a viewer near by, and where the model asks for the viewer."""
    big = Mesh([[-3, -3, 0], [3, -3, 0], [0, 4, 0]], [[0, 1, 2]])
    lamp = PointLight(position=(1, 0, 1), intensity=3)
    settings = Settings(width=24, height=24, samples=1, shading=shading)
    frame = render(Scene((Object(Shape(big, material)),), (lamp,)), Camera((0.4, -1, 2), (0, 0, 0)), settings)
    assert (frame.layers["object_id"] == 1).all()
    assert (np.ptp(frame.layers["beauty"], axis=(0, 1)) == 0).all()
    assert frame.layers["beauty"][..., :3].min() > 0
    assert frame.layers["specular"].any() == (shading == "flat" and isinstance(material, Phong))
