"""Which texels have one point, at their centre, or one for a block, and that they are as good as those of several."""

import numpy as np
import pytest
from meshes import grid, hills
from uv_meshes import icosphere, inward_cube, quads, rectangle, square

import obscurance.ao.texture.texels
from obscurance import ao
from obscurance.ao.points.receivers import find_receivers
from obscurance.ao.points.smooth_surface import SmoothSurface
from obscurance.ao.texture.coverage import Page
from obscurance.ao.texture.places import SLOTS
from obscurance.ao.texture.smooth_texels import smooth_cells
from obscurance.ao.texture.uv_layout import UVLayout, corner_uv
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.placement import Placement

pytestmark = pytest.mark.usefixtures("w_alone")

MOST = 0.2


def cells_of(mesh, uv, size, most=MOST, largest=1):
    """The coverage of a page, and its `smooth_cells`."""
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement)
    coverage = Page.of(UVLayout.of(corner_uv(uv, mesh), (size, size), True, "test")).cover("mean", 1)
    smooth = SmoothSurface.of(placement.vertices.astype(np.float64), receivers)
    return coverage, *smooth_cells(coverage, smooth, receivers.hierarchy.tree, most, 1.0, largest, 1)


def enough(mesh, uv, size, most=MOST):
    """Which texels need one point alone, (height, width), and which are covered as a whole."""
    coverage, alone, _ = cells_of(mesh, uv, size, most)
    pages = np.zeros((2, size * size), np.bool_)
    pages[:, coverage.texels] = alone, coverage.triangle[:, SLOTS] >= 0
    return pages.reshape(2, size, size)


def blocks(mesh, uv, size):
    """Side of the block that each texel is in, (height, width); 0 where it is not covered."""
    coverage, _, cell = cells_of(mesh, uv, size, largest=4)
    page = np.zeros(size * size, np.int64)
    page[coverage.texels] = np.sqrt(np.bincount(cell)[cell])
    return page.reshape(size, size)


def test_whole_texels_of_a_smooth_surface_have_one():
    one, whole = enough(*icosphere(3), 512)
    assert one[whole].mean() > 0.9
    assert not one[~whole].any()


def test_the_less_normals_may_differ_the_fewer_have_one():
    many, fewer, none = (enough(*icosphere(3), 256, most)[0].sum() for most in (0.2, 0.01, 0.0))
    assert many > 1.2 * fewer > none == 0


FLOOR = rectangle((0, -2, 0), (4, 0, 0), (0, 4, 0)), square(0, 0, 1, 0.75)
POST = rectangle((2.06, 0.06, 0), (0.01, 0, 0), (0, 0, 0.5)), square(0.1, 0.8, 0.9, 0.95)


def floor_and(rise, height=1.0):
    """A floor of texels of 1/8, and a strip that rises from its left edge, so much for each step to the left."""
    side = rectangle((0, -2, 0), (0, 4, 0), (-height / rise, 0, height)), square(0.1, 0.8, 0.9, 0.95)
    return quads(FLOOR, side)


def test_several_at_the_foot_of_a_wall():
    one, whole = enough(*floor_and(1e9), 32)
    floor = one[9:]  # the texels of the floor alone
    assert whole[9:].all()
    assert not floor[:, :2].any()
    assert floor[:, 6:].all()


@pytest.mark.parametrize(("rise", "several"), [(0.1, False), (3.0, True)])
def test_what_rises_gently_is_no_wall(rise, several):
    one, _ = enough(*floor_and(rise), 32)
    assert one[9:, :1].all() != several


def test_a_thin_thing_upon_a_floor_is_seen():
    one, _ = enough(*quads(FLOOR, POST), 32)
    assert not one[9 + 11, 16]
    assert one[9:].sum() > 500


@pytest.fixture
def set_single_points(monkeypatch):
    """A function: let texels that another function chooses have a single point."""

    def let(chosen):
        monkeypatch.setattr(obscurance.ao.texture.texels, "smooth_cells", chosen)

    return let


@pytest.mark.parametrize("falloff", [ao.Binary(), ao.Exponential()], ids=["binary", "exponential"])
def test_errors_of_one_point_and_of_several_are_of_a_size(set_single_points, falloff):
    """Of texels that are alike, every second one has a single point; that of four would be eightfold."""
    mesh = Mesh(*hills(14))
    uv, size = mesh.vertices[:, :2] / np.ptp(mesh.vertices[:, :2]) * 0.7 + 0.5, 64

    def every_second(coverage, *_):
        return (coverage.triangle[:, SLOTS] >= 0) & (coverage.texels % 2 == 0), np.arange(len(coverage.texels))

    set_single_points(every_second)
    texture = ao.bake_texture(mesh, uv, size, falloff, samples=64, denoise=False, close_seams=False)
    inside = slice(size // 4, 3 * size // 4)
    variance = texture.error[inside, inside].astype(float) ** 2
    assert texture.covered[inside, inside].all()
    assert 1 / 1.5 < variance[:, 0::2].mean() / variance[:, 1::2].mean() < 1.5


def test_one_point_is_as_near_to_the_truth_as_several(set_single_points):
    mesh, uv, _ = inward_cube(16)
    options = {"size": 64, "falloff": ao.Exponential(tau=2.0), "denoise": False, "close_seams": False}
    fine = ao.bake_texture(mesh, uv, **options | {"size": 256}, samples=256)
    true = fine.w.reshape(64, 4, 64, 4).mean(axis=(1, 3))
    whole = fine.covered.reshape(64, 4, 64, 4).all(axis=(1, 3))

    def error():
        return np.sqrt(np.mean((ao.bake_texture(mesh, uv, **options, samples=256).w - true)[whole] ** 2))

    mixed = error()

    def none(coverage, *_):
        return np.zeros(len(coverage.texels), np.bool_), np.arange(len(coverage.texels))

    set_single_points(none)
    assert mixed < 1.1 * error()


def valley():
    """A smooth valley on a grid, and its texture coordinates."""
    vertices, faces = grid(32, 2.0)
    x, y, _ = vertices.T
    mesh = Mesh(np.stack([x, y, 0.3 * np.cos(np.pi * (x + 0.3 * y**2))], axis=1), faces)
    return mesh, np.stack([x, y], axis=1) * 0.45 + 0.5


def test_blocks_of_a_smooth_surface_have_one():
    sizes = blocks(*valley(), 256)
    assert (sizes == 4).sum() > 0.5 * (sizes > 0).sum()


def test_blocks_keep_away_from_the_foot_of_a_wall():
    floor = blocks(*floor_and(1e9), 64)[16:]
    assert (floor[:, :2] == 1).all()
    assert (floor[:, 48:] == 4).all()
    distance = np.argmax(floor > 1, axis=1)
    assert (distance < np.argmax(floor > 2, axis=1)).all()


def test_no_block_reaches_under_a_thin_post():
    sizes = blocks(*quads(FLOOR, POST), 64)[16:]
    foot = np.s_[22:24, 32:34]
    assert (sizes[foot] == 1).all()
    assert (sizes == 4).sum() > 1000


@pytest.mark.parametrize("size", [30, 61])
def test_pages_of_any_size_have_blocks(size):
    sizes = blocks(*floor_and(1e9), size)
    assert (sizes == 4).any()
    assert sizes[-1, -1] > 0


def test_what_is_predicted_within_blocks_is_as_near_to_the_truth():
    mesh, uv = valley()
    options = {"size": 256, "falloff": ao.Binary(), "close_seams": False}
    fine = ao.bake_texture(mesh, uv, **options, samples=512)
    texture = ao.bake_texture(mesh, uv, **options, tolerance=0.01)
    error = np.sqrt(np.mean((texture.w - fine.w)[fine.covered] ** 2))
    assert error < 1.1 * 0.01
    assert error < 1.4 * texture.rmse
    assert (texture.covered == fine.covered).all()
    assert texture.rays_skipped["predicted"] > texture.rays
