"""Occlusion textures in pictures: obscurance that is a texture instead of numbers at the vertices."""

import io
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from obscurance.raytrace import (
    AmbientLight,
    Camera,
    DirectionalLight,
    Lambert,
    Mesh,
    Object,
    Occlusion,
    OptionError,
    Scene,
    Settings,
    Shape,
    Texture,
    render,
)

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
FACES = [[0, 1, 2], [0, 2, 3]]
MESH = Mesh(QUAD, FACES)
AHEAD = Camera(position=(0.5, 0.5, 3), target=(0.5, 0.5, 0), up=(0, 1, 0), height=1.0)
LIGHTS = (AmbientLight(intensity=(0.4, 0.4, 0.4)), DirectionalLight(direction=(0, 0, -1), intensity=(1, 1, 1)))
W = np.array([0.2, 0.9, 0.4, 1.0])


def png(codes):
    file = io.BytesIO()
    PIL.Image.fromarray(np.asarray(codes, np.uint8)).save(file, "PNG")
    return file.getvalue()


def ramp(w, strength=1.0):
    """What a bake writes: a grey ramp, and coordinates that point into it."""
    data = png(np.tile(np.arange(256), (4, 1)))
    uv = np.stack([(255 * w + 0.5) / 256, np.full(len(w), 0.5)], axis=1)
    return Occlusion(uv, Texture(Path("ramp.png"), data, srgb=False, wrap="clamp_to_edge"), strength)


def picture(item, **settings):
    return render(Scene((item,), LIGHTS), AHEAD, Settings(48, 48, samples=4, **settings)).layers


@pytest.mark.parametrize("shading", ["constant", "flat", "gouraud", "phong", "quadratic"])
@pytest.mark.parametrize("form", ["ambient", "ambient and diffuse", "off"])
def test_a_ramp_is_the_same_picture_as_w_at_the_vertices(shading, form):
    plain = Shape(MESH, Lambert(albedo=0.8))
    textured = Shape(MESH, Lambert(albedo=0.8), occlusion=ramp(W))
    expected = picture(Object(plain, w=W), shading=shading, obscurance=form)
    found = picture(Object(textured), shading=shading, obscurance=form)
    for name in ("beauty", "ambient", "diffuse", "obscurance"):
        # Gouraud's light is the product of interpolated numbers here, and an interpolated product there.
        np.testing.assert_allclose(found[name], expected[name], rtol=0, atol=2e-6, err_msg=name)
    assert np.ptp(found["obscurance"]) > 0.5
    assert (np.ptp(found["beauty"][8:-8, 8:-8, 0]) > 0.01) == (form != "off")


def test_strength_and_w_of_the_object_count():
    shape = Shape(MESH, Lambert(albedo=0.8), occlusion=ramp(W, 0.25))
    expected = picture(Object(Shape(MESH, Lambert(albedo=0.8)), w=0.5 * (1 + 0.25 * (W - 1))))
    found = picture(Object(shape, w=np.full(4, 0.5)))
    np.testing.assert_allclose(found["obscurance"], expected["obscurance"], rtol=0, atol=1e-6)
    np.testing.assert_allclose(found["beauty"], expected["beauty"], rtol=0, atol=1e-6)


def test_the_red_channel_counts_as_it_is_and_has_coordinates_of_its_own():
    codes = np.zeros((2, 2, 3))
    codes[..., 0] = [[51, 102], [153, 204]]
    codes[..., 1:] = 255
    red = Texture(Path("red.png"), png(codes), srgb=False, wrap="clamp_to_edge")
    albedo = Texture(Path("grey.png"), png(np.full((1, 1), 188)))
    halves = 0.25 + 0.5 * QUAD[:, :2]  # texel centres at the corners
    shape = Shape(MESH, Lambert(albedo=1.0), np.zeros((4, 2)), albedo, Occlusion(halves, red))
    found = picture(Object(shape))["obscurance"][..., 0]
    along = (np.arange(48) + 0.5) / 48  # from the left, and from the top
    np.testing.assert_allclose(found, 0.2 + 0.2 * along[None, :] + 0.4 * along[:, None], rtol=0, atol=0.006)


def test_instances_share_a_texture():
    shape = Shape(MESH, Lambert(albedo=1.0), occlusion=ramp(W))
    half = np.diag([0.5, 1, 1, 1])
    beside = half.copy()
    beside[0, 3] = 0.5
    found = render(Scene((Object(shape, half), Object(shape, beside)), LIGHTS), AHEAD, Settings(48, 48, samples=1))
    left, right = np.split(found.layers["obscurance"][..., 0], 2, axis=1)
    np.testing.assert_allclose(left, right, atol=1e-5)
    assert np.ptp(left) > 0.5


def test_without_them_w_of_the_vertices_is_all():
    shape = Shape(MESH, Lambert(albedo=0.8), occlusion=ramp(W))
    bare = Scene((Object(shape), Object(shape)), LIGHTS).without_occlusion()
    assert bare.objects[0].shape is bare.objects[1].shape
    assert bare.objects[0].shape.occlusion is None


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: ramp(W, 1.5), r"strength: expected a number in \[0, 1\], got 1.5"),
        (lambda: ramp(W, float("nan")), "strength: expected"),
        (lambda: Occlusion(np.zeros((4, 3)), Texture(Path("a.png"))), r"uv: expected shape \(n, 2\), got \(4, 3\)"),
        (
            lambda: Shape(MESH, Lambert(albedo=1), occlusion=ramp(W[:3])),
            "occlusion: expected texture coordinates of 4 vertices",
        ),
        (
            lambda: Shape(MESH, Lambert(albedo=1), occlusion=Texture(Path("a.png"))),
            "occlusion: expected a raytrace.Occlusion",
        ),
        (lambda: Shape(MESH, Lambert(albedo=1), uv=np.zeros((3, 2))), r"uv: expected .*\(4, 2\)"),
        (lambda: Object(Shape(MESH, Lambert(albedo=1)), w=np.ones(3)), r"w: expected .*\(4,\)"),
    ],
)
def test_mistakes(make, expected):
    with pytest.raises(OptionError, match=expected):
        make()
