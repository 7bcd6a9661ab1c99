"""Every texel that a face reaches into is covered, by points that lie on faces and within the texel."""

import numpy as np
import pytest
from uv_meshes import grid_charts

from obscurance.ao.texture.coverage import Page
from obscurance.ao.texture.places import SLOTS
from obscurance.ao.texture.uv_layout import UVLayout


def laid_out(uv, size=(24, 16), wraps=True):
    return UVLayout.of(np.asarray(uv, float), size, wraps, "test")


def samples_of(coverage):
    """The row of the texel of each sample, its face and barycentric coordinates."""
    starts, face, barycentric = coverage.every_sample(2)
    return np.repeat(np.arange(len(coverage.texels)), np.diff(starts)), face, barycentric


def corners_of(coverage):
    """The upper left corner of each covered texel, (k, 2)."""
    return np.stack([coverage.texels % 24, coverage.texels // 24], axis=1)


def places(layout, face, barycentric):
    """Where samples lie on the page, (p, 2)."""
    return np.einsum("pc,pcd->pd", barycentric.astype(float), layout.uv[face])


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
    coverage = Page.of(layout).cover("mean", 1)
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
    coverage = Page.of(layout).cover("mean", 2)
    row, face, barycentric = samples_of(coverage)
    assert (np.bincount(row, minlength=len(coverage.texels)) >= SLOTS).all()
    assert (face >= 0).all()
    assert (barycentric >= 0).all()
    assert np.allclose(barycentric.sum(axis=1), 1, atol=1e-6)
    inside = places(layout, face, barycentric) - corners_of(coverage)[row]
    assert inside.min() > -1e-4
    assert inside.max() < 1 + 1e-4


def test_the_points_of_whole_texels_have_the_centre_for_a_mean():
    layout = laid_out([[(-1, -1), (3, -1), (-1, 3)]], wraps=False)
    coverage = Page.of(layout).cover("mean", 1)
    assert len(coverage.texels) == 24 * 16
    assert (coverage.triangle[:, SLOTS] >= 0).all()
    _, *samples = samples_of(coverage)
    found = places(layout, *samples).reshape(-1, SLOTS, 2)
    centre = corners_of(coverage) + 0.5
    for several in (found.mean(axis=1), found[:, :2].mean(axis=1), found[:, 2:].mean(axis=1)):
        assert np.allclose(several, centre, atol=1e-4)


def test_four_parts_have_a_point_in_each_of_sixteen_cells_and_further_ones_are_even_within():
    layout = laid_out([[(-1, -1), (3, -1), (-1, 3)]], wraps=False)
    parts = np.tile(np.arange(64), 24)
    coverage = Page.of(layout).cover("mean", 1, np.repeat(np.arange(24), 64), parts, np.uint32(5))
    _, *samples = samples_of(coverage)
    found = (places(layout, *samples) % 1).reshape(24, 64, SLOTS, 2)
    cells = np.floor(4 * found).astype(int) @ [4, 1]
    assert (np.sort(cells.reshape(24, 16, 16), axis=2) == np.arange(16)).all()
    shares = np.mean(found.reshape(24, 256, 2) @ np.array([[0.8, 0.6], [0.6, -0.8]]).T > [0.53, 0.11], axis=1)
    assert np.std(shares, axis=0).max() < 0.7 * 256**-0.75  # by chance alone .03


def test_texels_that_look_alike_have_other_points():
    layout = laid_out([[(-1, -1), (3, -1), (-1, 3)]], wraps=False)
    pages = [Page.of(layout).cover("mean", 1, key=np.uint32(key)) for key in (1, 1, 2)]
    first, again, other = [places(layout, *samples_of(page)[1:]).reshape(-1, SLOTS, 2) % 1 for page in pages]
    assert (first == again).all()
    assert (abs(first - other).max(axis=(1, 2)) > 0.01).mean() > 0.9
    assert len(np.unique(np.floor(4 * first).astype(int).reshape(-1, 2), axis=0)) == 16


def test_points_are_spread_over_what_a_texel_has_of_a_face():
    layout = laid_out([[(0, 0), (0.3, 0), (0, 400)]], (4, 4), wraps=False)  # a fifth of the second column
    coverage = Page.of(layout).cover("mean", 1)
    row, *samples = samples_of(coverage)
    found = places(layout, *samples)[coverage.texels[row] % 4 == 1].reshape(4, SLOTS, 2)
    assert np.allclose(found[:, :, 0].mean(axis=1), 1.1, atol=0.03)
    assert (np.ptp(found[:, :, 1], axis=1) > 0.5).all()


@pytest.mark.parametrize("count", [*range(2, 12), 40, 64])
def test_faces_over_one_another_have_equally_many_points_about_the_centre(count):
    whole = [(-1, -1), (3, -1), (-1, 3)]
    layout = laid_out([whole, whole[::-1]] * (count // 2) + [whole] * (count % 2), wraps=False)
    coverage = Page.of(layout).cover("mean", 1)
    assert coverage.overlapping.all()
    rows, face, barycentric = samples_of(coverage)
    of_each = np.bincount(rows * count + face)
    assert len(of_each) == len(coverage.texels) * count
    assert (of_each == of_each[0]).all()
    if count <= 4:
        centre = corners_of(coverage) + 0.5
        found = places(layout, face, barycentric)
        for layer in range(count):
            mine = face == layer
            sums = np.stack([np.bincount(rows[mine], found[mine, axis]) for axis in range(2)], axis=1)
            assert np.allclose(sums / of_each[0], centre, atol=1e-4)
    first = Page.of(layout).cover("first", 1)
    assert not first.all_count.any()
    assert (np.diff(first.every_sample(1).starts) == SLOTS).all()


def test_of_very_many_faces_over_one_another_sixty_four_have_a_point():
    layout = laid_out([[(-1, -1), (3, -1), (-1, 3)]] * 200, wraps=False)
    coverage = Page.of(layout).cover("mean", 1)
    samples = coverage.every_sample(1)
    assert (np.diff(samples.starts) == 64).all()
    assert np.ptp(np.diff(np.sort(samples.face[:64]))) <= 1


def test_overlapping_faces_share_a_texel_or_the_first_has_it():
    one = [(0.1, 0.1), (0.9, 0.1), (0.1, 0.9)]
    layout = laid_out([one, one[::-1], one])
    every = Page.of(layout).cover("mean", 1)
    assert every.overlapping.mean() > 0.8
    rows, face, _ = samples_of(every)
    of_overlapping = every.overlapping[rows]
    faces = np.unique(3 * rows[of_overlapping] + face[of_overlapping])
    assert len(faces) == 3 * np.count_nonzero(every.overlapping)
    first = Page.of(layout).cover("first", 1)
    assert np.array_equal(first.texels, every.texels)
    assert (first.every_sample(1).face == 0).all()


def test_neighbours_do_not_overlap():
    rng = np.random.default_rng(1)
    x, y = np.meshgrid(np.arange(20), np.arange(20))
    points = (np.stack([x, y], axis=-1) + rng.uniform(0.2, 0.8, (20, 20, 2)) * 0.6) / 20
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    uv = np.concatenate([np.stack(t, axis=-2).reshape(-1, 3, 2) for t in ((a, b, c), (a, c, d))])
    assert not Page.of(laid_out(uv, (256, 256))).cover("mean", 1).overlapping.any()


def test_a_face_whose_area_on_the_page_is_rounded_away_crowds_nothing():
    tiny = 1e-20
    layout = laid_out([[[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]], [[0, 0], [tiny, 0], [0, tiny]]])
    crowding = Page.of(layout, np.array([1.0, 1.0])).crowding
    assert crowding[0] > 0
    assert crowding[1] == 0
