"""Skies and environment images: exact where they are uniform, closed forms, bent normals, and what metals mirror."""

import numpy as np
import pytest

from obscurance.raytrace import (
    AmbientLight,
    BlinnPhong,
    Camera,
    CookTorrance,
    EnvironmentLight,
    InputError,
    Lambert,
    Object,
    OptionError,
    Scene,
    Settings,
    Shape,
    SkyLight,
    render,
)
from obscurance.raytrace.brdf.material import pack_materials
from obscurance.raytrace.image.write import write_image, write_layers
from obscurance.raytrace.lights.environment import (
    cone_visibility,
    harmonic_irradiance,
    map_radiance,
    pack_environment,
    sky_irradiance,
    sky_radiance,
)
from obscurance.scenes.geometry.primitives import sphere

BALL = sphere(0.5, 0.1)
CAMERA = Camera((0, -3, 1), (0, 0, 0), height=1)
COLOUR = (0.3, 0.5, 0.7)
SKY = SkyLight(zenith=(0.1, 0.2, 1.0), horizon=(0.9, 0.6, 0.3), ground=(0.2, 0.3, 0.1), up=(0.1, -0.2, 0.9))
MATT, GOLD = Lambert(albedo=(0.2, 0.5, 0.9)), CookTorrance(albedo=0, m=0.2, eta=20, k_a=(0.9, 0.7, 0.3))
PLASTIC = BlinnPhong(k_d=0.3, k_s=0.5)


def picture(material, *lights, w=None, bent=None, **settings):
    item = Object(Shape(BALL.mesh, material), w=w, bent_normals=bent)
    return render(Scene((item,), lights), CAMERA, Settings(24, 24, samples=1, **settings)).layers


def test_a_sky_of_one_colour_is_ambient_light_exactly():
    plain, sky = AmbientLight(intensity=COLOUR), SkyLight(zenith=COLOUR, horizon=COLOUR, ground=COLOUR)
    for material in (MATT, GOLD, PLASTIC):
        for shading in ("phong", "constant", "gouraud"):
            expected, found = (picture(material, light, shading=shading)["beauty"] for light in (plain, sky))
            np.testing.assert_array_equal(found, expected)
    w = np.random.default_rng(0).random(len(BALL.mesh.vertices))
    bent = BALL.mesh.normals + 0.5 * np.random.default_rng(1).normal(size=(len(w), 3))
    for form in ("ambient", "ambient and diffuse", "off"):
        expected, found = (picture(MATT, light, w=w, bent=bent, obscurance=form)["beauty"] for light in (plain, sky))
        np.testing.assert_array_equal(found, expected)


def hemisphere_mean(radiance, n, count=400):
    """(1/π) ∫ L(d) ⟨n·d⟩ dω by quadrature over the whole sphere."""
    z = (np.arange(count) + 0.5) / count * 2 - 1
    phi = (np.arange(2 * count) + 0.5) * np.pi / count
    s = np.sqrt(1 - z**2)
    d = np.stack([s[:, None] * np.cos(phi), s[:, None] * np.sin(phi), z[:, None] + 0 * phi], axis=-1)
    cosine = np.maximum(0, d @ n)
    return np.einsum("hw,hwc->c", cosine, radiance(d)) * (2 / count) * (np.pi / count) / np.pi


def of_gradient(sky):
    zenith, horizon, ground, up = (np.array(a) for a in (sky.zenith, sky.horizon, sky.ground, sky.up))
    up = up / np.linalg.norm(up)

    def radiance(d):
        height = (d @ up)[..., None]
        return np.where(height > 0, horizon + (zenith - horizon) * height, ground)

    return radiance


def test_light_of_a_gradient_on_an_open_ball_is_its_integral():
    layers = picture(Lambert(albedo=1), SKY)
    rows, columns = np.nonzero(layers["object_id"][..., 0])
    for row, column in list(zip(rows, columns, strict=True))[::37]:
        n = layers["normal"][row, column].astype(float)
        np.testing.assert_allclose(layers["ambient"][row, column], hemisphere_mean(of_gradient(SKY), n), atol=2e-4)
    facing, away = ([float(c) for c in sky_irradiance(SKY.row(), s * SKY.row()[9:])] for s in (1, -1))
    np.testing.assert_allclose(facing, np.array(SKY.horizon) / 3 + np.array(SKY.zenith) * 2 / 3, rtol=1e-12)
    np.testing.assert_allclose(away, SKY.ground, rtol=1e-12)


def test_a_gradient_is_mirrored_sharply_or_blurred():
    row, radiance = SKY.row(), of_gradient(SKY)
    for d in np.random.default_rng(2).normal(size=(20, 3)):
        d /= np.linalg.norm(d)
        np.testing.assert_allclose(sky_radiance(row, tuple(d), 0.0), radiance(d), atol=1e-3)
    horizon = np.cross(row[9:], (1, 0, 0)) / np.linalg.norm(np.cross(row[9:], (1, 0, 0)))
    blurred = np.array(sky_radiance(row, tuple(horizon), 0.1))
    assert np.abs(blurred - (np.array(SKY.horizon) + SKY.ground) / 2).max() < 0.05


def test_bent_normals_bring_light_nearer_to_the_integral():
    """A wall over a floor under a sky: w with the bent normal against w with the normal, truth by rays."""
    sky = SkyLight(zenith=(0.2, 0.4, 1.0), horizon=(1.0, 0.8, 0.6), ground=0.1)
    d = np.random.default_rng(3).normal(size=(100_000, 3))
    d[:, 0] = np.abs(d[:, 0])
    d /= np.linalg.norm(d, axis=1)[:, None]
    apart = {"bent": [], "normal": []}
    for height in (0.05, 0.2, 0.5, 1.0):
        reach = -height / np.minimum(d[:, 2], -1e-12)  # along d to the floor, 2 wide and 4 long
        blocked = (d[:, 2] < 0) & (reach * d[:, 0] < 2) & (np.abs(reach * d[:, 1]) < 2)
        open_ = (2 * d[:, 0] * ~blocked)[:, None]  # (1/π) ⟨n·d⟩ over the density 1/(2π)
        w, bent, truth = open_.mean(), (open_ * d).mean(axis=0), (open_ * of_gradient(sky)(d)).mean(axis=0)
        for name, axis in (("bent", bent / np.linalg.norm(bent)), ("normal", np.array([1.0, 0, 0]))):
            apart[name].append(w * np.array(sky_irradiance(sky.row(), tuple(axis))) - truth)
    errors = {name: np.sqrt(np.mean(np.square(values))) for name, values in apart.items()}
    assert errors["normal"] > 0.1
    assert errors["bent"] < 0.55 * errors["normal"]


def test_light_is_looked_up_along_the_bent_normals_of_vertices():
    w = np.full(len(BALL.mesh.vertices), 0.5)
    up = np.broadcast_to([0.3, -0.6, 0.7], BALL.mesh.vertices.shape)
    for shading in ("phong", "gouraud"):
        layers = picture(Lambert(albedo=1), SKY, w=w, bent=up, shading=shading)
        lit = layers["object_id"][..., 0] > 0
        same = lit & (layers["normal"] @ np.array([0.3, -0.6, 0.7]) > 0.3)
        expected = 0.5 * np.array(sky_irradiance(SKY.row(), tuple(np.array(up[0]) / np.linalg.norm(up[0]))))
        np.testing.assert_allclose(layers["ambient"][same], np.tile(expected, (same.sum(), 1)), rtol=1e-5)


def test_metals_mirror_the_sky_and_closed_corners_are_dark():
    sky = SkyLight(zenith=1, horizon=1, ground=0)
    layers = picture(GOLD, sky)
    n = layers["normal"]
    sees_ground = (layers["object_id"][..., 0] > 0) & (n[..., 2] < -0.2)
    sees_sky = n[..., 2] > 0.6
    assert layers["ambient"][sees_sky][:, 0].mean() > 0.5
    assert layers["ambient"][sees_sky].mean() > 4 * layers["ambient"][sees_ground].mean()
    matt = picture(Lambert(albedo=0, k_a=GOLD.k_a), sky)
    assert np.abs(matt["ambient"] - layers["ambient"]).max() > 0.1
    assert picture(GOLD, sky, w=np.zeros(len(BALL.mesh.vertices)))["ambient"].max() < 1e-6
    assert [cone_visibility(w, 0.4, 0.2) for w in (0.0, 1.0)] == [0, 1]
    assert cone_visibility(0.3, 1.3, 0.2) < 0.05 < 0.5 < cone_visibility(0.3, 0.1, 0.2) <= 1
    for slope in (0.2, 0.5):  # half of a cone of half-angle √2 slope whose axis lies w of that past the open one's edge
        assert cone_visibility(0.5, np.pi / 4 + 0.5 * np.sqrt(2) * slope, slope) == pytest.approx(0.5)


def test_no_more_is_mirrored_than_the_material_reflects_of_ambient_light():
    for row in pack_materials([GOLD, PLASTIC, CookTorrance(albedo=0.5, k_s=0.5, m=0.1)])[1]:
        assert (row[11:17] >= 0).all()
    light = SkyLight(zenith=50, horizon=50, ground=50)
    assert picture(PLASTIC, light)["ambient"].max() <= 0.3 * 50 * (1 + 1e-6)


@pytest.fixture
def panorama(tmp_path):
    """64×32: a bright window in front, +y, over a dim room."""
    image = np.full((32, 64, 3), 0.1, np.float32)
    image[10:16, 28:36] = (8.0, 6.0, 4.0)
    write_layers(tmp_path / "room.exr", {"beauty": image}, {}, half=False)
    return tmp_path / "room.exr", image


def test_harmonics_of_an_image_are_its_irradiance_to_a_few_per_cent(panorama):
    path, image = panorama
    _, harmonics, maps, frame = pack_environment([EnvironmentLight(image=path)])

    def radiance(d):
        row = np.minimum((np.arccos(np.clip(d[..., 2], -1, 1)) / np.pi * 32).astype(int), 31)
        column = ((0.5 + np.arctan2(d[..., 0], d[..., 1]) / (2 * np.pi)) * 64).astype(int) % 64
        return image[row, column].astype(float)

    largest = hemisphere_mean(radiance, np.array([0, 1.0, 0]))
    for n in np.array([[0, 1, 0], [0, -1, 0], [1, 0, 0], [0, 0.6, 0.8], [0, 0, -1.0]]):
        found = harmonic_irradiance(harmonics, tuple(n))
        apart = np.abs(found - hemisphere_mean(radiance, n)).max()
        assert apart < 0.09 * largest.max()  # bound: Ramamoorthi & Hanrahan
    sharp = map_radiance(maps, frame, (0.0, np.cos(0.3), np.sin(0.3)), 0.0)
    np.testing.assert_allclose(sharp, (8, 6, 4), rtol=1e-3)
    rough = map_radiance(maps, frame, (0.0, 1.0, 0.0), 0.4)
    assert 0.2 < rough[0] < 4


def test_an_image_of_one_colour_is_ambient_light_and_turns_with_up(tmp_path, panorama):
    write_layers(tmp_path / "grey.exr", {"beauty": np.full((8, 16, 3), 0.5, np.float32)}, {}, half=False)
    plain = picture(GOLD, AmbientLight(intensity=0.5))["beauty"]
    np.testing.assert_allclose(picture(GOLD, EnvironmentLight(image=tmp_path / "grey.exr"))["beauty"], plain, atol=1e-5)
    path, _ = panorama
    for up, turn, towards in (((0, 0, 1), 0, (0, 1, 0)), ((0, 0, 1), 90, (-1, 0, 0)), ((0, 1, 0), 0, (0, 0, -1))):
        _, _, maps, frame = pack_environment([EnvironmentLight(image=path, up=up, turn=turn)])
        d = np.array(towards) * np.cos(0.3) + np.array(up) * np.sin(0.3)
        assert map_radiance(maps, frame, tuple(d), 0.0)[0] > 7


def test_faults_of_environments_are_named(tmp_path, panorama):
    path, image = panorama
    write_image(tmp_path / "square.png", image[:, :32])
    with pytest.raises(InputError, match="size: expected twice as wide as high, 360° by 180°, got 32×32"):
        pack_environment([EnvironmentLight(image=tmp_path / "square.png")])
    with pytest.raises(InputError, match=r"none\.exr"):
        pack_environment([EnvironmentLight(image=tmp_path / "none.exr")])
    with pytest.raises(OptionError, match="lights: expected one environment image at most, got 2"):
        pack_environment([EnvironmentLight(image=path)] * 2)
    with pytest.raises(OptionError, match="EnvironmentLight: image: expected the path of an image, got 3"):
        EnvironmentLight(image=3)
    with pytest.raises(OptionError, match="bent_normals: expected shape"):
        Object(Shape(BALL.mesh, MATT), bent_normals=np.zeros((3, 3)))
