"""Thin things just above blocks of texels, and things far up in a cone of rays, are near: none there is predicted."""

import numpy as np
import pytest
from meshes import hills
from numpy.lib.stride_tricks import sliding_window_view
from site_families import leaves
from uv_meshes import quads, rectangle, square

from obscurance import ao
from obscurance.ao.points.receivers import find_receivers
from obscurance.ao.points.smooth_surface import SmoothSurface
from obscurance.ao.texture.coverage import Page
from obscurance.ao.texture.smooth_texels import smooth_cells
from obscurance.ao.texture.uv_layout import UVLayout, corner_uv
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.placement import Placement

pytestmark = pytest.mark.usefixtures("w_alone")

FLOOR = rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), square(0, 0, 1, 1)


def over_floor(things):
    """A floor on all of a page, under rectangles that are not on it."""
    mesh, uv = quads(FLOOR, *((thing, square(0, 0, 1, 1)) for thing in things))
    uv = uv[mesh.faces]
    uv[2:] = np.nan
    return mesh, uv


@pytest.mark.parametrize(
    ("seed", "height"), [(2, 1e-5), *(pytest.param(1, height, marks=pytest.mark.slow) for height in (1e-4, 1e-6))]
)
@pytest.mark.filterwarnings("ignore::obscurance.ao.ToleranceWarning")
def test_texels_on_either_side_of_a_leaf_s_edge_are_not_predicted_from_one(seed, height):
    size = 64
    mesh, uv, exact = leaves(seed, size, height)
    baked = ao.bake_texture(mesh, uv, size, "binary", samples=256, tolerance=0.01, close_seams=False, seed=seed)
    whole = (exact == 0) | (exact == 1)  # other texels are crossed by an edge, and denoised with those beside them
    whole = sliding_window_view(np.pad(whole, 1, mode="edge"), (3, 3)).all(axis=(2, 3))
    assert np.sqrt(np.mean((baked.w - exact)[whole] ** 2)) < 0.005
    assert baked.rays_skipped["predicted"] > 0


@pytest.mark.parametrize("relief", [0.05, 0.15])
def test_a_smooth_surface_is_not_over_itself(relief):
    """However many of its faces are about a block."""
    vertices, faces = hills(150)
    mesh = Mesh(vertices * [1, 1, relief], faces)
    uv = (vertices[:, :2] / 2 + 0.5)[faces]
    _, cell = cells(mesh, uv, 128, 1.0)
    assert np.mean(cell != np.arange(len(cell))) > 0.9


def cells(mesh, uv, size, tangent):
    """`smooth_cells` of the page, by blocks of up to 4 × 4 texels."""
    placement = Placement.of(mesh)
    found = find_receivers(mesh, placement)
    coverage = Page.of(UVLayout.of(corner_uv(uv, mesh), (size, size), True, "test")).cover("mean", 1)
    smooth = SmoothSurface.of(placement.vertices.astype(np.float64), found)
    return smooth_cells(coverage, smooth, found.hierarchy.tree, 0.2, tangent, 4, 1)


@pytest.mark.parametrize("far", [1.0, 3.0, 8.0, 20.0])
@pytest.mark.parametrize("times", [0.7, 3.0])
def test_what_is_near_in_a_cone_is_farther_up_the_narrower_it_is(far, times):
    """Seven times the way to a block's texels, over the tangent."""
    size = 32
    reach = 7 * np.sqrt(8) * 2 / size
    strips = [rectangle((x, -1, times * far * reach), (0.05, 0, 0), (0, 2, 0)) for x in np.arange(-1, 1, 0.1)]
    mesh, uv = over_floor(strips)
    _, cell = cells(mesh, uv, size, 1 / far)
    in_large = np.bincount(cell)[cell] == 16
    assert in_large.all() if times > 1 else not in_large.any()


def under_slats(spread, size, phase):
    """A floor under slats that are .4 above it, and w (size,) of its columns in a cone of rays, by quadrature."""
    height, pitch, width = 0.4, 0.25, 0.1
    starts = np.arange(-1.5, 1.5, pitch) + phase
    slats = [rectangle((x, -4, height), (0, 8, 0), (width, 0, 0)) for x in starts]
    most = np.sin(np.radians(spread / 2)) ** 2
    sines = (np.arange(400) + 0.5) / 400 * most
    turns = (np.arange(200) + 0.5) / 200 * 2 * np.pi
    away = height * np.sqrt(sines / (1 - sines))[:, None] * np.cos(turns)
    places = (np.arange(4 * size) + 0.5) / (4 * size) * 2 - 1
    free = [np.mean((x + away - starts[0]) % pitch > width) for x in places]
    return over_floor(slats), np.reshape(free, (size, 4)).mean(axis=1)


@pytest.mark.parametrize("spread", [60, 10])
def test_a_floor_under_slats_in_a_cone(spread):
    size, tolerance = 128, 0.005
    (mesh, uv), w = under_slats(spread, size, 0.031)
    baked = ao.bake_texture(
        mesh, uv, size, "binary", tolerance=tolerance, close_seams=False, spread=spread, seed=spread
    )
    inner = slice(size // 2 - 40, size // 2 + 40)  # from where no ray passes beside the slats
    true = np.sqrt(np.mean((np.asarray(baked.w, float) - w)[inner] ** 2))
    assert true < 1.3 * tolerance
    assert baked.rmse > true / 1.6
