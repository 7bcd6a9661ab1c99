"""Every texel that a face reaches into is covered, by points that lie on faces and within the texel."""

import numpy as np
import pytest
from uv_meshes import grid_charts

from ao.texture.coverage import cover
from ao.texture.page_rays import SLOTS
from ao.texture.uv_layout import UVLayout


def laid_out(uv, size=(24, 16), wraps=True):
    return UVLayout.of(np.asarray(uv, float), size, wraps, "test")


def places(layout, coverage):
    """Where the points of covered texels lie on the page, (k, SLOTS, 2)."""
    corners = layout.uv[coverage.face]
    return np.einsum("ksc,kscd->ksd", coverage.barycentric.astype(float), corners)


def clipped_area(triangle, column, row):
    """Area that a triangle and a texel have in common, by clipping with one half-plane after the other."""
    polygon = [tuple(corner) for corner in triangle]
    for axis, bound, sign in ((0, column, 1), (0, column + 1, -1), (1, row, 1), (1, row + 1, -1)):
        kept = []
        for here, there in zip(polygon, polygon[1:] + polygon[:1], strict=True):
            a, b = sign * (here[axis] - bound), sign * (there[axis] - bound)
            if a >= 0:
                kept.append(here)
            if a * b < 0:
                t = a / (a - b)
                kept.append(tuple(p + t * (q - p) for p, q in zip(here, there, strict=True)))
        polygon = kept
    ahead = polygon[1:] + polygon[:1]
    return abs(sum(p[0] * q[1] - q[0] * p[1] for p, q in zip(polygon, ahead, strict=True))) / 2


TRIANGLES = {
    "a large one": [[(0.1, 0.1), (0.9, 0.2), (0.3, 0.95)]],
    "a needle": [[(0.05, 0.51), (0.97, 0.5101), (0.5, 0.5102)]],
    "a speck": [[(0.501, 0.502), (0.502, 0.502), (0.501, 0.5035)]],
    "turned over": [[(0.1, 0.1), (0.3, 0.95), (0.9, 0.2)]],
    "many": grid_charts(300),
}


@pytest.mark.parametrize("uv", TRIANGLES.values(), ids=TRIANGLES)
def test_coverage_is_conservative_and_no_more(uv):
    layout = laid_out(uv)
    coverage = cover(layout, "mean", 1)
    areas = np.zeros((16, 24))
    for triangle in layout.corners:
        low, high = np.floor(triangle.min(axis=0)).astype(int), np.ceil(triangle.max(axis=0)).astype(int)
        for row in range(low[1], high[1]):
            for column in range(low[0], high[0]):
                areas[row, column] += clipped_area(triangle, column, row)
    covered = np.zeros(16 * 24, np.bool_)
    covered[coverage.texels] = True
    assert covered[areas.ravel() > 1e-5].all()
    assert not covered[areas.ravel() == 0].any()


@pytest.mark.parametrize("uv", TRIANGLES.values(), ids=TRIANGLES)
def test_points_lie_on_faces_and_in_their_texels(uv):
    layout = laid_out(uv)
    coverage = cover(layout, "mean", 2)
    assert coverage.face.shape == (len(coverage.texels), SLOTS)
    assert (coverage.face >= 0).all()
    assert (coverage.barycentric >= 0).all()
    assert np.allclose(coverage.barycentric.sum(axis=2), 1, atol=1e-6)
    corner = np.stack([coverage.texels % 24, coverage.texels // 24], axis=1)
    inside = places(layout, coverage) - corner[:, None]
    assert inside.min() > -1e-4
    assert inside.max() < 1 + 1e-4


def test_the_points_of_whole_texels_have_the_centre_for_a_mean():
    layout = laid_out([[(-1, -1), (3, -1), (-1, 3)]], wraps=False)
    coverage = cover(layout, "mean", 1)
    assert len(coverage.texels) == 24 * 16
    found = places(layout, coverage)
    centre = np.stack([coverage.texels % 24, coverage.texels // 24], axis=1) + 0.5
    for several in (found.mean(axis=1), found[:, :2].mean(axis=1), found[:, 2:].mean(axis=1)):
        assert np.allclose(several, centre, atol=1e-4)


def test_points_are_spread_over_what_a_texel_has_of_a_face():
    layout = laid_out([[(0, 0), (0.3, 0), (0, 400)]], (4, 4), wraps=False)  # a fifth of the second column
    coverage = cover(layout, "mean", 1)
    found = places(layout, coverage)[coverage.texels % 4 == 1]
    assert np.allclose(found[:, :, 0].mean(axis=1), 1.1, atol=0.03)
    assert (np.ptp(found[:, :, 1], axis=1) > 0.5).all()


def test_two_faces_over_one_another_have_the_centre_for_a_mean_each():
    whole = [(-1, -1), (3, -1), (-1, 3)]
    layout = laid_out([whole, whole[::-1]], wraps=False)
    coverage = cover(layout, "mean", 1)
    centre = np.stack([coverage.texels % 24, coverage.texels // 24], axis=1) + 0.5
    found = places(layout, coverage)
    for face in (0, 1):
        mine = coverage.face == face
        assert (mine.sum(axis=1) == SLOTS // 2).all()
        assert np.allclose((found * mine[:, :, None]).sum(axis=1) / 2, centre, atol=1e-4)
    assert (coverage.face[:, 0] != coverage.face[:, 1]).all()
    assert not coverage.deep.any()


def test_more_faces_over_one_another_have_more_points():
    whole = [(-1, -1), (3, -1), (-1, 3)]
    layout = laid_out([whole] * 4, wraps=False)
    coverage = cover(layout, "mean", 1)
    assert coverage.deep.all()
    centre = np.stack([coverage.texels % 24, coverage.texels // 24], axis=1) + 0.5
    found = np.einsum("ksc,kscd->ksd", coverage.deep_barycentric.astype(float), layout.uv[coverage.deep_face])
    for face in range(4):
        mine = coverage.deep_face == face
        assert (mine.sum(axis=1) == 4).all()
        assert np.allclose((found * mine[:, :, None]).sum(axis=1) / 4, centre, atol=1e-4)
    assert (np.sort(coverage.deep_face[:, :4], axis=1) == range(4)).all()  # all that few rays go to
    assert not cover(layout, "first", 1).deep.any()


def test_overlapping_faces_share_a_texel_or_the_first_has_it():
    one = [(0.1, 0.1), (0.9, 0.1), (0.1, 0.9)]
    layout = laid_out([one, one[::-1], one])
    every = cover(layout, "mean", 1)
    assert every.overlapping.mean() > 0.8
    whole = every.face[every.overlapping]
    together = [set(row) == {0, 1, 2} for row in whole.tolist()]
    assert np.mean(together) > 0.6  # not at the rim
    first = cover(layout, "first", 1)
    assert np.array_equal(first.texels, every.texels)
    assert (first.face[first.overlapping] == 0).all()


def test_neighbours_do_not_overlap():
    rng = np.random.default_rng(1)
    x, y = np.meshgrid(np.arange(20), np.arange(20))
    points = (np.stack([x, y], axis=-1) + rng.uniform(0.2, 0.8, (20, 20, 2)) * 0.6) / 20
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    uv = np.concatenate([np.stack(t, axis=-2).reshape(-1, 3, 2) for t in ((a, b, c), (a, c, d))])
    assert not cover(laid_out(uv, (256, 256)), "mean", 1).overlapping.any()
