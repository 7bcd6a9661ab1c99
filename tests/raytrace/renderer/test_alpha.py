"""Alpha in pictures: layers front to back, cut-outs, shadows of both, against values composited by hand."""

import io
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from obscurance.raytrace import (
    AlphaSurface,
    AmbientLight,
    Camera,
    DirectionalLight,
    InputError,
    Lambert,
    Mesh,
    Object,
    Opacity,
    PointLight,
    Scene,
    Settings,
    Shape,
    Strauss,
    Texture,
    render,
)
from obscurance.raytrace.renderer.render import rendering_bytes, seen_vertices

SHADINGS = ["constant", "flat", "gouraud", "phong", "quadratic"]


AHEAD = Camera(position=(0.5, 0.5, 3), target=(0.5, 0.5, 0), up=(0, 1, 0), height=1.0)
BELOW_CARDS = Camera(position=(0.5, 0.5, 0.2), target=(0.5, 0.5, 0), up=(0, 1, 0), height=1.0)
BACKGROUND = np.array([0.25, 0.5, 0.75])
RED, GREEN, BLUE, WHITE = np.array([1, 0, 0.0]), np.array([0, 1, 0.0]), np.array([0, 0, 1.0]), np.ones(3)
AMBIENT = (AmbientLight(intensity=(1, 1, 1)),)
DOWN = (DirectionalLight(direction=(0, 0, -1), intensity=(np.pi,) * 3),)  # a white Lambert floor gets 1


def shape(colour=WHITE, alpha=None, size=1.0, material=None, fineness=1):
    """A square about (½, ½, 0)."""
    steps = np.linspace(0, 1, fineness + 1)
    uv = np.array([[x, y] for y in steps for x in steps])
    row, column = np.divmod(np.arange(fineness**2), fineness)
    first = row * (fineness + 1) + column
    faces = np.concatenate([first[:, None] + [0, 1, fineness + 2], first[:, None] + [0, fineness + 2, fineness + 1]])
    places = np.concatenate([size * (uv - 0.5) + 0.5, np.zeros((len(uv), 1))], axis=1)
    mesh = Mesh(places, faces)
    if alpha is not None:
        mesh = Mesh(places, faces, opacity=Opacity.uniform(alpha, faces, uv if alpha.texture else None))
    return Shape(mesh, material or Lambert(albedo=tuple(colour)))


def at(height, made):
    matrix = np.eye(4)
    matrix[2, 3] = height
    return Object(made, matrix)


def picture(items, lights=AMBIENT, camera=AHEAD, **settings):
    settings = {"samples": 1, "obscurance": "off"} | settings
    return render(Scene(tuple(items), lights, tuple(BACKGROUND)), camera, Settings(16, 16, **settings))


def half_cut(kind="LA"):
    """An image whose left half has alpha 1 (or, grey, is white) and whose right half has 0."""
    content = io.BytesIO()
    codes = np.array([[[90, 255], [90, 0]]]) if kind == "LA" else np.array([[255, 0]])
    PIL.Image.fromarray(codes.astype(np.uint8), kind).save(content, "PNG")
    return Texture(Path("half.png"), content.getvalue(), srgb=False, wrap="clamp_to_edge")


@pytest.mark.parametrize("shading", SHADINGS)
def test_layers_are_composited_front_to_back_over_the_background(shading):
    """In every pixel, those that look at the edge of two triangles included."""
    items = at(0, shape(RED, AlphaSurface(0.3))), at(0.1, shape(GREEN, AlphaSurface(0.5)))
    layers = picture(items, shading=shading).layers
    expected = 0.5 * GREEN + 0.5 * 0.3 * RED + 0.5 * 0.7 * BACKGROUND
    np.testing.assert_allclose(layers["beauty"][..., :3], np.broadcast_to(expected, (16, 16, 3)), atol=1e-6)
    np.testing.assert_allclose(layers["beauty"][..., 3], 1 - 0.5 * 0.7, atol=1e-6)
    np.testing.assert_allclose(layers["ambient"][3, 3], 0.5 * GREEN + 0.5 * 0.3 * RED, atol=1e-6)


def test_what_lies_behind_is_what_is_there():
    cards = at(0.2, shape(BLUE, AlphaSurface(0.25))), at(0.1, shape(GREEN, AlphaSurface(0.5)))
    frame = picture([at(0, shape(RED, size=3)), *cards], samples=7)
    expected = 0.25 * BLUE + 0.75 * (0.5 * GREEN + 0.5 * RED)
    np.testing.assert_allclose(frame.layers["beauty"][4:12, 4:12, :3], np.broadcast_to(expected, (8, 8, 3)), atol=1e-6)
    assert (frame.layers["beauty"][..., 3] == 1).all()


@pytest.mark.parametrize("alpha", [0.3, 0.5, 1.0])
def test_each_ray_goes_on_behind_what_it_has_met(alpha):
    """Through a heap of small cards, so that some rays go on where their neighbours have ended."""
    rng = np.random.default_rng(1)
    low, sizes, colours = rng.uniform(-0.2, 0.9, (60, 2)), rng.uniform(0.1, 0.5, (60, 2)), rng.uniform(size=(60, 3))
    centres = (np.arange(16) + 0.5) / 16
    x, y = np.meshgrid(centres, centres[::-1])
    expected, items = np.broadcast_to(BACKGROUND, (16, 16, 3)), []
    for row, (corner, size, colour) in enumerate(zip(low, sizes, colours, strict=True)):
        surface = AlphaSurface(texture=half_cut(), cutoff=0.5) if row % 3 == 0 else AlphaSurface(alpha)
        matrix = np.diag([*size, 1.0, 1.0])
        matrix[:3, 3] = *corner, 0.01 * row
        items.append(Object(shape(colour, surface), matrix))
        s, t = (x - corner[0]) / size[0], (y - corner[1]) / size[1]
        card = (s > 0) & (s < (0.5 if row % 3 == 0 else 1)) & (t > 0) & (t < 1)
        part = np.where(card, 1.0 if row % 3 == 0 else alpha, 0.0)[..., None]
        expected = part * colour + (1 - part) * expected
    np.testing.assert_allclose(picture(items).layers["beauty"][..., :3], expected, atol=1e-5)


def test_a_hole_hides_nothing_that_lies_in_it():
    cut = AlphaSurface(texture=half_cut(), cutoff=0.5)
    inlaid = [at(0, shape(GREEN, cut)), at(0, shape(RED))]
    assert (picture(inlaid).layers["beauty"][:, 8:, :3] == RED).all()
    above = [at(0.4, shape(GREEN, cut, size=2)), at(0.4, shape(size=2)), at(0, shape())]
    assert (picture(above, DOWN, BELOW_CARDS).layers["shadow"] == 0).all()


def test_copies_of_a_shape_are_layers_too():
    glass = shape(GREEN, AlphaSurface(0.5))
    beauty = picture([at(0, shape(WHITE)), *(at(height, glass) for height in (0.1, 0.2, 0.3))]).layers["beauty"]
    np.testing.assert_allclose(beauty[..., :3], np.broadcast_to(0.875 * GREEN + 0.125, (16, 16, 3)), atol=1e-6)


def test_layers_that_are_no_light_are_of_the_surface_that_hides_half_of_what_is_behind_it():
    thin = AlphaSurface(0.3)
    items = [at(height, shape(colour, thin)) for height, colour in ((0.3, RED), (0.2, GREEN), (0.1, BLUE))]
    layers = picture(items, samples=5).layers
    assert (layers["object_id"] == 2).all()  # .7² < ½
    np.testing.assert_allclose(layers["depth"], 2.8, atol=1e-6)
    np.testing.assert_allclose(layers["albedo"], np.broadcast_to(GREEN, (16, 16, 3)))
    layers = picture(items[:1]).layers
    assert (layers["object_id"] == 0).all()
    assert np.isinf(layers["depth"]).all()
    np.testing.assert_allclose(layers["beauty"][..., 3], 0.3, atol=1e-6)


@pytest.mark.parametrize("shading", SHADINGS)
@pytest.mark.parametrize("light", [DOWN, (PointLight(position=(0.5, 0.5, 50), intensity=(np.pi * 2500,) * 3),)])
def test_shadows_of_layers_multiply(shading, light):
    cards = [at(height, shape(RED, AlphaSurface(alpha), size=9)) for height, alpha in ((0.4, 0.5), (0.6, 0.25))]
    lit, dim = (
        picture([at(0, shape()), *others], light, BELOW_CARDS, shading=shading).layers for others in ([], cards)
    )
    np.testing.assert_allclose(dim["shadow"], 0.5 * 0.75, rtol=1e-6)
    np.testing.assert_allclose(dim["beauty"][..., :3], 0.375 * lit["beauty"][..., :3], rtol=1e-5)
    dark = picture([at(0, shape()), *cards, at(0.8, shape(size=9))], light, BELOW_CARDS, shading=shading)
    assert not dark.layers["beauty"][..., :3].any()


@pytest.mark.parametrize(
    "surface",
    [
        AlphaSurface(texture=half_cut(), cutoff=0.5),
        AlphaSurface(0.8, half_cut("L"), grey=True, cutoff=0.4),
    ],
)
@pytest.mark.parametrize("shading", ["constant", "phong", "gouraud"])
def test_the_shadow_of_a_card_that_is_half_cut_away_is_that_of_half_a_card(surface, shading):
    fine = 16 if shading == "gouraud" else 1
    items = at(0, shape(fineness=fine)), at(0.4, shape(GREEN, surface, size=2))
    shadow = picture(items, DOWN, BELOW_CARDS, shading=shading).layers["shadow"][..., 0]
    clear = 7 if shading == "gouraud" else 8  # vertices next to the edge are linear
    assert (shadow[:, :clear] == 0).all()
    assert (shadow[:, 16 - clear :] == 1).all()


@pytest.mark.parametrize("shading", SHADINGS)
def test_holes_alone_change_no_bit(shading):
    """By kernels that see through, what those for opaque scenes make."""
    lights = (AmbientLight(intensity=(0.2, 0.2, 0.2)), PointLight(position=(0.2, 0.9, 2), intensity=(3, 2, 1)))
    items = [at(0, shape(fineness=3)), at(0.4, shape(RED, size=0.5)), at(1, shape(BLUE, size=0.25))]
    camera = Camera(position=(0.3, -1, 2), target=(0.5, 0.5, 0), up=(0, 0, 1))
    hole = at(0.7, shape(GREEN, AlphaSurface(0.0), size=0.9))
    opaque, pierced = (picture(each, lights, camera, samples=9, shading=shading) for each in (items, [*items, hole]))
    for name, values in opaque.layers.items():
        assert np.array_equal(pierced.layers[name], values), name
    assert pierced.rays["primary"] == opaque.rays["primary"]


def test_a_transparent_material_shows_what_is_behind_and_lets_light_through():
    glass = Strauss(colour=tuple(GREEN), smoothness=0.0, transparency=0.75)
    beauty = picture([at(0, shape(RED)), at(0.4, shape(material=glass))]).layers["beauty"]
    np.testing.assert_allclose(beauty, np.broadcast_to([0.75, 0.25, 0, 1], (16, 16, 4)), atol=1e-6)
    shadow = picture([at(0, shape()), at(0.4, shape(material=glass))], DOWN, BELOW_CARDS).layers["shadow"]
    np.testing.assert_allclose(shadow, 0.75, rtol=1e-6)
    cut = AlphaSurface(texture=half_cut(), cutoff=0.5)
    beauty = picture([at(0, shape(RED)), at(0.4, shape(alpha=cut, material=glass))]).layers["beauty"]
    np.testing.assert_allclose(beauty[0, [0, -1], :3], [[0.75, 0.25, 0], RED], atol=1e-6)


def test_a_bake_of_a_scene_has_the_alpha_of_its_meshes_and_materials():
    glass = shape(material=Strauss(colour=0.5, smoothness=0.5, transparency=0.75))
    both = shape(alpha=AlphaSurface(0.5), material=glass.material)
    cut = shape(alpha=AlphaSurface(0.5, cutoff=0.2), material=glass.material)
    flat = Scene(tuple(at(0, each) for each in (shape(), glass, both, cut))).flattened()
    assert [0.0 if n < 0 else flat.opacity.surfaces[n].factor for n in flat.opacity.of[::2]] == [0, 0.25, 0.125, 0.5]
    assert Scene((at(0, shape()),)).flattened().opacity is None
    assert Scene((at(0, cut),)).without_alpha().objects[0].shape.mesh.opacity is None


def test_vertices_that_are_seen_through_layers_are_seen():
    def seen(surface):
        items = at(0, shape()), at(0.4, shape(alpha=surface))
        return seen_vertices(Scene(items), AHEAD, Settings(16, 16, samples=1)).reshape(2, 4).all(axis=1).tolist()

    assert seen(AlphaSurface(0.5)) == [True, True]
    assert seen(AlphaSurface(0.0)) == [True, False]
    assert seen(AlphaSurface(1.0)) == [False, True]


def test_alpha_that_cannot_be_read_is_one_line_and_its_memory_is_estimated(tmp_path):
    scene = Scene((at(0, shape(alpha=AlphaSurface(texture=Texture(tmp_path / "none.png")))),))
    with pytest.raises(InputError, match=r"none\.png: file: expected an existing file, got none"):
        render(scene, AHEAD, Settings(16, 16))
    PIL.Image.new("LA", (1000, 500)).save(tmp_path / "none.png")
    opaque = rendering_bytes(scene.without_alpha(), Settings(16, 16), False)
    assert rendering_bytes(scene, Settings(16, 16), False) - opaque == pytest.approx(8 * 1000 * 500, rel=0.01)
