"""The grain of anisotropic materials from texture space: along u, and as a texture of directions has it."""

import io
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from obscurance.raytrace import (
    AshikhminShirley,
    Camera,
    DirectionalLight,
    EllipticalBeckmann,
    Kajiya,
    Lambert,
    Mesh,
    Object,
    OptionError,
    PoulinFournier,
    Scene,
    Settings,
    Shape,
    Texture,
    Ward,
    render,
)

QUAD = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float), [[0, 1, 2], [0, 2, 3]])
UV = QUAD.vertices[:, :2]
ALONG_U, ALONG_V = (255, 127), (127, 255)
LIGHTS = (DirectionalLight(direction=(0.2, 0.5, -1), intensity=1),)
BRUSHED = [
    lambda **own: EllipticalBeckmann(albedo=0, m_parallel=0.1, m_perpendicular=0.5, **own),
    lambda **own: PoulinFournier(k_d=0.1, k_s=0.5, spacing=3, **own),
    lambda **own: Ward(k_d=0, k_s=0.5, m_parallel=0.1, m_perpendicular=0.5, **own),
    lambda **own: AshikhminShirley(albedo=0, exponent_parallel=200, exponent_perpendicular=8, **own),
    lambda **own: Kajiya(height=150, correlation_parallel=4000, correlation_perpendicular=800, **own),
]


def directions(*colours):
    """A texture of one row of texels (red, green)."""
    file = io.BytesIO()
    PIL.Image.fromarray(np.array([[(*colour, 0) for colour in colours]], np.uint8)).save(file, "PNG")
    return Texture(Path("grain.png"), file.getvalue(), srgb=False, wrap="clamp_to_edge")


def picture(material, uv=UV, transform=None, below=False, **shape):
    item = Object(Shape(QUAD, material, uv, **shape), np.eye(4) if transform is None else transform)
    camera = Camera((0.5, 0.2, -3 if below else 3), (0.5, 0.5, 0), up=(0, 1, 0), height=1.2)
    lights = (DirectionalLight(direction=(0.2, 0.5, 1), intensity=1),) if below else LIGHTS
    return render(Scene((item,), lights), camera, Settings(16, 16, samples=1)).layers["specular"]


@pytest.mark.parametrize("brushed", BRUSHED)
def test_every_anisotropic_model_follows_the_texture_of_directions(brushed):
    """8 bits have no 0: the direction is .2° off."""
    along_x, along_y = picture(brushed(grain=(1, 0, 0))), picture(brushed(grain=(0, 1, 0)))
    size = max(along_x.max(), along_y.max())
    assert np.abs(along_x - along_y).max() > 0.2 * size
    np.testing.assert_allclose(picture(brushed()), along_x, atol=1e-5 * size)
    for colour, expected in ((ALONG_U, along_x), (ALONG_V, along_y), ((0, 127), along_x)):
        found = picture(brushed(), grain=directions(colour))
        np.testing.assert_allclose(found, expected, atol=0.06 * size)


def test_the_texture_is_looked_up_where_the_surface_is_hit():
    brushed = BRUSHED[2]
    both = picture(brushed(), grain=directions(ALONG_U, ALONG_U, ALONG_V, ALONG_V))
    left, right = picture(brushed(), grain=directions(ALONG_U)), picture(brushed(), grain=directions(ALONG_V))
    np.testing.assert_allclose(both[:, :5], left[:, :5], rtol=1e-5)
    np.testing.assert_allclose(both[:, 11:], right[:, 11:], rtol=1e-5)
    assert np.abs(left - right).max() > 0.1


@pytest.mark.parametrize("below", [False, True])
def test_v_is_v_on_mirrored_coordinates_and_from_behind(below):
    """A diagonal in texture space is the other diagonal where u is reversed, seen from either side."""
    brushed = BRUSHED[2]
    diagonal = directions((217, 217))
    sheet = {"two_sided": "viewer", "below": below}
    expected = [picture(brushed(grain=g, two_sided="viewer"), below=below) for g in ((1, 1, 0), (-1, 1, 0))]
    assert np.abs(expected[0] - expected[1]).max() > 0.05
    found = [
        picture(brushed(two_sided=sheet["two_sided"]), uv * sign, below=below, grain=diagonal)
        for uv, sign in ((UV, (1, 1)), (UV, (-1, 1)))
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-5)


def test_a_texture_that_points_nowhere_leaves_the_grain_along_u():
    brushed = BRUSHED[2]
    np.testing.assert_array_equal(picture(brushed(), grain=directions((127, 128))), picture(brushed()))


def test_a_grain_that_nothing_could_follow_is_refused():
    texture = directions(ALONG_U)
    brushed = BRUSHED[0](grain=(1, 0, 0))
    for material, got in ((Lambert(albedo=0.5), "lambert"), (brushed, f"{brushed.model} with a grain")):
        expected = f"grain: expected an anisotropic material without a grain of its own, got {got}$"
        with pytest.raises(OptionError, match=expected):
            Shape(QUAD, material, UV, grain=texture)
    with pytest.raises(OptionError, match="uv: expected texture coordinates"):
        Shape(QUAD, BRUSHED[0](), grain=texture)
    item = Object(Shape(QUAD, BRUSHED[0](), UV, grain=texture))
    with pytest.raises(OptionError, match="shading: expected another one where a texture has the grain, got gouraud"):
        render(Scene((item,), LIGHTS), Camera((0, 1, 3), (0, 0, 0)), Settings(4, 4, shading="gouraud"))
