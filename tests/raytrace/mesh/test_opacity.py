"""Alpha of faces: what is accepted, what is packed, and what kernels find at a place."""

import numpy as np
import PIL.Image
import pytest

from obscurance.raytrace import AlphaSurface, InputError, Lambert, Mesh, Object, Opacity, Scene, Shape, Texture
from obscurance.raytrace.mesh.opacity import alphas

UV = np.array([[[0.0, 0], [1, 0], [0, 1]]])
CORNERS, FACE = np.eye(3), [[0, 1, 2]]
CODES = np.random.default_rng(0).integers(0, 256, (5, 7), np.uint8)
PLACES = np.random.default_rng(1).dirichlet([1, 1, 1], 200)[:, 1:]


def png(path, alpha, mode="RGBA"):
    """An image whose alpha, or whose grey, are these codes."""
    codes = np.dstack([np.full((*alpha.shape, 3), 90, np.uint8), alpha]) if mode == "RGBA" else alpha
    PIL.Image.fromarray(codes).save(path)
    return Texture(path)


def found(opacity, places=PLACES):
    out = np.empty(len(places))
    alphas(opacity.packed(), np.zeros(len(places), np.int64), np.ascontiguousarray(places), out)
    return out


def bilinear(codes, u, v):
    """Of an image that repeats, by NumPy."""
    height, width = codes.shape
    x, y = u * width - 0.5, (1 - v) * height - 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    s, t = x - i, y - j
    corner = lambda a, b: codes[(j + b) % height, (i + a) % width] / 255  # noqa: E731
    return (1 - t) * ((1 - s) * corner(0, 0) + s * corner(1, 0)) + t * ((1 - s) * corner(0, 1) + s * corner(1, 1))


@pytest.mark.parametrize(("mode", "grey"), [("RGBA", False), ("RGBA", True), ("L", True)])
def test_alpha_is_factor_times_corners_times_texture(tmp_path, mode, grey):
    surface = AlphaSurface(0.7, png(tmp_path / "leaf.png", CODES, mode), grey)
    uv, corners = 3 * UV - 1, np.array([[1.0, 0.5, 0.25]])
    u, v = PLACES.T
    expected = 0.7 * bilinear(CODES, 3 * u - 1, 3 * v - 1) * (1 - u - v + 0.5 * u + 0.25 * v)
    assert np.allclose(found(Opacity([0], [surface], uv, corners)), expected, atol=1e-6)


def test_a_cutoff_leaves_holes(tmp_path):
    surface = AlphaSurface(texture=png(tmp_path / "leaf.png", CODES), cutoff=0.5)
    expected = bilinear(CODES, *PLACES.T) >= 0.5
    assert 0.2 < expected.mean() < 0.8
    assert np.array_equal(found(Opacity([0], [surface], UV)), expected)


def test_faces_that_are_opaque_everywhere_have_no_alpha(tmp_path):
    solid = png(tmp_path / "solid.png", np.full((2, 2), 255, np.uint8))
    half = png(tmp_path / "half.png", np.full((2, 2), 128, np.uint8))
    grey = png(tmp_path / "grey.png", CODES, "L")
    opaque = (
        AlphaSurface(),
        AlphaSurface(texture=solid),
        AlphaSurface(texture=half, cutoff=0.5),
        AlphaSurface(texture=grey),
    )
    for surface in opaque:
        assert Opacity([0], [surface], UV).packed() is None
    packed = Opacity([0, 1, -1], [AlphaSurface(0.5), AlphaSurface()]).packed()
    assert packed.of.tolist() == [0, -1, -1]
    assert packed.only(np.array([False, True, True])) is None
    assert packed.only(np.array([True, False, True])).of.tolist() == [0, -1]


def test_a_scene_in_one_mesh_keeps_the_alpha_of_its_objects():
    uv = np.arange(6.0).reshape(1, 3, 2)
    leaf = Shape(Mesh(CORNERS, FACE, opacity=Opacity([0], [AlphaSurface(0.25)], uv)), Lambert(albedo=0.5))
    stone = Shape(Mesh(CORNERS, FACE), Lambert(albedo=0.5))
    flipped = np.diag([-1.0, 1, 1, 1])
    flat = Scene((Object(stone), Object(leaf), Object(leaf, flipped))).flattened()
    assert flat.opacity.of.tolist() == [-1, 0, 1]
    assert [surface.factor for surface in flat.opacity.surfaces] == [0.25, 0.25]
    assert np.array_equal(flat.opacity.uv[1:], [uv[0], uv[0, ::-1]])
    assert Scene((Object(stone), Object(stone))).flattened().opacity is None


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: AlphaSurface(np.nan), "factor"),
        (lambda: AlphaSurface(1.5), "factor"),
        (lambda: AlphaSurface(cutoff=-0.1), "cutoff"),
        (lambda: AlphaSurface(cutoff=np.nan), "cutoff"),
        (lambda: AlphaSurface(texture="leaf.png"), "texture"),
        (lambda: Opacity([1], [AlphaSurface()]), "of"),
        (lambda: Opacity([0.5], [AlphaSurface()]), "of"),
        (lambda: Opacity([0], [0.5]), "surfaces"),
        (lambda: Opacity([0], [AlphaSurface(texture=Texture("leaf.png"))]), "uv"),
        (lambda: Opacity([0], [AlphaSurface()], UV[:, :2]), "uv"),
        (lambda: Opacity([0], [AlphaSurface()], UV / [0, 1]), "uv"),
        (lambda: Opacity([0], [AlphaSurface()], corners=[[1, 2, 1]]), "corners"),
        (lambda: Mesh(CORNERS, FACE, opacity=Opacity([0, 0], [AlphaSurface()])), "opacity"),
        (lambda: Mesh(CORNERS, FACE, opacity=0.5), "opacity"),
        (lambda: Opacity([0], [AlphaSurface(texture=Texture("no.png"))], UV).packed(), "file"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:(divide|invalid)")
def test_alpha_that_makes_no_sense_is_refused(make, field):
    with pytest.raises(InputError) as refused:
        make()
    assert refused.value.field == field
    assert "\n" not in str(refused.value)
