"""Texels that show more of the surface than four points see: means over all of it, and errors that know of the rest."""

from functools import cache

import numpy as np
import pytest
from uv_meshes import quads, rectangle, square

from obscurance import ao
from obscurance.ao import closed_forms
from obscurance.ao.points.receivers import find_receivers
from obscurance.ao.points.smooth_surface import SmoothSurface
from obscurance.ao.texture.coverage import Page
from obscurance.ao.texture.smooth_texels import smooth_cells
from obscurance.ao.texture.uv_layout import UVLayout, corner_uv
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.placement import Placement

pytestmark = pytest.mark.usefixtures("w_alone")

TAU, SIDE = 1.0, 4.0
WALL = rectangle((0, 60, 0), (0, -120, 0), (0, 0, 60))
STEPS = (np.arange(400) + 0.5) * SIDE / 400


@cache
def exact():
    """w of the floor at `STEPS` from the wall."""
    return np.array([closed_forms.wall(x, tau=TAU) for x in STEPS])


def floor_by_a_wall(charts, cells=1):
    """A square floor of `cells` × `cells` squares, each with a chart, by a wall that is not on the page."""
    step = SIDE / cells
    corners = [(k // cells * step, k % cells * step - 2, 0) for k in range(cells**2)]
    pieces = [(rectangle(at, (step, 0, 0), (0, step, 0)), chart) for at, chart in zip(corners, charts, strict=True)]
    mesh, uv = quads(*pieces, (WALL, square(0, 0, 1, 1)))
    uv = uv[mesh.faces]
    uv[-2:] = np.nan
    return mesh, uv


def bake(mesh, uv, size, samples=1024, falloff=None, seed=0):
    falloff = falloff or ao.Exponential(tau=TAU)
    return ao.bake_texture(mesh, uv, size, falloff, samples=samples, close_seams=False, seed=seed)


def check_the_only_texel(mesh, uv, size):
    """That the one texel covered is the mean of the floor, by the mean over six seeds, which errs by some .0012."""
    textures = [bake(mesh, uv, size, seed=seed) for seed in range(6)]
    assert all(texture.covered.sum() == 1 for texture in textures)
    assert abs(np.mean([texture.w[texture.covered] for texture in textures]) - exact().mean()) < 0.004
    assert all(texture.rmse < 0.01 for texture in textures)


@pytest.mark.parametrize(("size", "at"), [(8, 0), (8, 0.3), (8, 0.5), (8, 0.999999), (1024, 0.3), (1024, 0.999999)])
def test_charts_of_a_millionth_of_the_page(size, at):
    check_the_only_texel(*floor_by_a_wall([square(0.1, 0.1, 0.9, 0.9) * 1e-6 + at]), size)


@pytest.mark.parametrize("side", [0.01, 0.03, 0.06, 0.1])
@pytest.mark.parametrize("at", [0.251, 0.27])
def test_a_texel_with_all_of_a_chart_is_its_mean(at, side):
    check_the_only_texel(*floor_by_a_wall([square(at, at, at + side, at + side)]), 8)


@pytest.mark.parametrize(("cells", "size", "most"), [(6, 8, 0.01), (12, 10, 0.016), (30, 8, 0.03), (4, 32, 0.003)])
def test_texels_with_several_charts_are_means_over_all_and_report_their_error(cells, size, most):
    order = np.random.default_rng(3).permutation(cells**2)
    charts = [(square(0, 0, 0.8, 0.8) + np.divmod(place, cells)) / cells for place in order]
    texture = bake(*floor_by_a_wall(charts, cells), size)
    fine = 64 * size
    places = (np.arange(fine) + 0.5) / fine * cells  # of points of the page, in charts
    chart, along = places.astype(int), places % 1 / 0.8
    square_of = np.argsort(order)[chart[:, None] * cells + chart]
    x = (square_of // cells + along[:, None]) * SIDE / cells
    there = (along < 1)[:, None] & (along < 1)
    values = there * np.interp(x, STEPS, exact())
    sums, counts = (each.reshape(size, 64, size, 64).sum(axis=(1, 3)).T[::-1] for each in (values, there))
    assert np.array_equal(texture.covered, counts > 0)
    true = np.sqrt(np.mean((texture.w[counts > 0] - sums[counts > 0] / counts[counts > 0]) ** 2))
    assert true < most
    assert true / 2 < texture.rmse < 2 * true


def floor_under(strips):
    """A floor on all of the page, under strips (m, 4, 3) that are not on it."""
    floor = rectangle((0, 0, 0), (4, 0, 0), (0, 4, 0)), square(0, 0, 1, 1)
    mesh, uv = quads(floor, *((strip, square(0, 0, 1, 1)) for strip in strips))
    uv = uv[mesh.faces]
    uv[2:] = np.nan
    return mesh, uv


def fins(gap, height, width=0.12, slope=0.5):
    """Strips along y, every `gap` one, that lie `height` above the floor and rise in x."""
    rise = (width, 0, slope * width)
    return [rectangle((x - width / 2, 0, height), rise, (0, 4, 0)) for x in np.arange(gap / 2, 4, gap)]


@pytest.mark.parametrize(("gap", "height"), [(0.5, 0.02), (0.3, 0.02), (0.5, 0.05), (0.37, 0.03)])
def test_texels_under_narrow_fins_report_their_error(gap, height):
    mesh, uv = floor_under(fins(gap, height))
    fine = bake(mesh, uv, 8 * 16, 256, ao.Binary()).w.reshape(8, 16, 8, 16).mean(axis=(1, 3))
    texture = bake(mesh, uv, 8, falloff=ao.Binary())
    true = np.sqrt(np.mean((texture.w - fine) ** 2))
    assert true < 0.1
    assert texture.rmse > true / 1.5


@pytest.mark.parametrize(("height", "several"), [(0.02, True), (0.2, True), (3.0, False)])
def test_low_things_over_a_floor_are_near_its_texels(height, several):
    mesh, uv = floor_under(fins(1.0, height))
    placement = Placement.of(mesh)
    found = find_receivers(mesh, placement)
    coverage = Page.of(UVLayout.of(corner_uv(uv, mesh), (8, 8), True, "test")).cover("mean", 1)
    smooth = SmoothSurface.of(placement.vertices.astype(np.float64), found)
    alone, _ = smooth_cells(coverage, smooth, found.hierarchy.tree, 0.2, 1.0, 1, 1)
    assert alone.any() != several


def test_the_error_of_a_page_of_one_texel_is_finite():
    mesh = Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    texture = bake(mesh, [(0.3, 0.3), (0.4, 0.3), (0.3, 0.4)], 1, 16)
    assert texture.w.tolist() == [[1]]
    assert texture.rmse < 0.05
