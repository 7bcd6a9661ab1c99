"""Adaptive sampling of pixels: a silhouette is smoothed wherever it lies, and tiles leave no trace."""

import numpy as np
import pytest
from rendered import CAMERA, SMALL, still_scene

from obscurance.raytrace import Lambert, Mesh
from obscurance.raytrace.camera import Camera
from obscurance.raytrace.image.colour import encode_srgb
from obscurance.raytrace.renderer import render_job as module
from obscurance.raytrace.renderer.render import render
from obscurance.raytrace.scene import Object, Scene, Shape
from obscurance.raytrace.settings import Settings

SIDE = 64


def half_plane(at, axis):
    """A glowing half-plane that begins `at` pixels from the left or the lower side; the picture, (row, column)."""
    low, high = np.full(2, -500.0), np.full(2, 500.0)
    low[axis] = at
    corners = [[low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0]]
    glow = Object(Shape(Mesh(corners, [[0, 1, 2], [0, 2, 3]]), Lambert(albedo=0, emission=1)))
    camera = Camera((SIDE / 2, SIDE / 2, 50), (SIDE / 2, SIDE / 2, 0), (0, 1, 0), height=SIDE)
    frame = render(Scene((glow,)), camera, Settings(width=SIDE, height=SIDE, samples=64))
    return frame.layers["beauty"][::-1, :, 0]


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("at", [16.2, 23.8, 24.2, 31.8, 32.2, 47.8])
def test_every_pixel_along_an_edge_has_its_share_of_it(at, axis):
    """The filter of the pixels beyond the edge's own reaches over it by 0.3: its samples must be looked for there."""
    picture = half_plane(at, axis)
    beside = int(at) + (1 if at % 1 > 0.5 else -1)
    line = picture[:, beside] if axis == 0 else picture[beside]
    assert ((line > 0) & (line < 1)).all()


@pytest.mark.parametrize(("left", "top"), [(0, 5), (7, 0), (9, 13)])
def test_the_picture_does_not_depend_on_where_tiles_begin(left, top, monkeypatch):
    still = still_scene()
    whole = render(still, CAMERA, SMALL).layers
    monkeypatch.setattr(module, "whole_tiles", lambda _: (left, top, 96 - left, 64 - top))
    crop = (left + 1, top + 1, 95 - left, 63 - top)
    part = render(still, CAMERA, Settings(width=96, height=64, samples=16, crop=crop)).layers
    differs = np.zeros((63 - top, 95 - left), np.bool_)
    for name, layer in whole.items():
        differs |= (part[name] != layer[top + 1 :, left + 1 :]).any(axis=2)
    assert np.mean(differs) < 0.02  # where shades begin to change so fast that pixels get all samples
    error = np.sqrt(part["beauty"][..., :3]) - np.sqrt(whole["beauty"][top + 1 :, left + 1 :, :3])
    assert np.abs(error).max() < 0.25 / 255


def test_pixels_on_a_tile_s_edge_that_agree_with_all_around_stay_retired():
    camera = Camera((0, 0, 50), (0, 0, 0), (0, 1, 0), height=1)
    glow = Object(Shape(Mesh([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], [[0, 1, 2]]), Lambert(albedo=0, emission=1)))
    frame = render(Scene((glow,)), camera, Settings(width=40, height=40, samples=64))
    assert frame.rays["primary"] == 4 * 40 * 40
    assert frame.rays_skipped["primary_agreed"] == 60 * 40 * 40


def wires(name, width, seed, grey=0.0, **camera):
    """Glowing wires of a width in pixels at 256 samples: linear values (row, column), and their area in pixels."""
    ends = {"diagonal": [(5.3, 3.1, 59.2, 60.7)], "fence": [(x + 0.37, 6, x + 0.9, 58) for x in range(6, 60, 6)]}[name]
    corners, faces = [], []
    for x, y, to_x, to_y in ends:
        begin, end = np.array([x, y]), np.array([to_x, to_y])
        side = np.array([y - to_y, to_x - x]) * width / 2 / np.hypot(to_x - x, to_y - y)
        first = len(corners)
        faces += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
        corners += [begin - side, end - side, end + side, begin + side]
    mesh = Mesh(np.column_stack([corners, np.zeros(len(corners))]), faces)
    view = Camera((SIDE / 2, SIDE / 2, SIDE), (SIDE / 2, SIDE / 2, 0), (0, 1, 0), **camera or {"height": SIDE})
    scene = Scene((Object(Shape(mesh, Lambert(albedo=0, emission=1))),), background=(grey,) * 3)
    frame = render(scene, view, Settings(width=SIDE, height=SIDE, samples=256, seed=seed))
    area = width * sum(np.hypot(to_x - x, to_y - y) for x, y, to_x, to_y in ends)
    return frame.layers["beauty"][..., 0].astype(float), area


ANGLE = 2 * np.degrees(np.arctan(0.5))
LENSES = (
    {},
    {"field_of_view": ANGLE, "aperture": 2.0, "focus": 96.0},
    {"field_of_view": ANGLE, "aperture": 6.0, "focus": 128.0},
)


@pytest.mark.parametrize("width", [0.25, 0.1, 0.05])
@pytest.mark.parametrize(("name", "camera"), [("diagonal", {}), *(("fence", camera) for camera in LENSES)])
def test_no_part_of_a_wire_is_missed(name, width, camera):
    """The filter's weights sum to 1 over the pixels: so do the shares of a wire's pixels to its area."""
    for seed in (1, 2):
        picture, area = wires(name, width, seed, **camera)
        assert picture.sum() == pytest.approx(area, rel=0.03)


@pytest.mark.parametrize("camera", LENSES)
@pytest.mark.parametrize("width", [0.25, 0.1])
def test_wires_do_not_depend_on_the_seed(width, camera):
    first, second = (encode_srgb(wires("fence", width, seed, 0.3, **camera)[0]) for seed in (1, 2))
    assert (np.abs(first - second) > 16 / 255).sum() == 0


def out_of_focus(samples, seed):
    """A glowing square far in front of what is sharp: its rim is 30 pixels wide."""
    square = Mesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    glow = Object(Shape(square, Lambert(albedo=0, emission=1)))
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), field_of_view=45, aperture=2.0, focus=10.0)
    settings = Settings(width=SIDE, height=SIDE, samples=samples, seed=seed)
    return render(Scene((glow,)), camera, settings).layers["beauty"][..., 0].astype(float)


def test_what_is_out_of_focus_does_not_depend_on_the_seed():
    """Places on the lens are independent of places in the pixel. The reference has no pixel that is retired early."""
    reference = np.mean([out_of_focus(4, seed) for seed in range(100)], axis=0)
    for seed in (1, 2):
        error = out_of_focus(256, seed) - reference
        assert np.abs(error).max() < 0.08
        assert np.sqrt(np.mean(error**2)) < 0.015
