"""Texture coordinates as they come: outside of the unit square, turned over, without area, or none at all."""

import numpy as np
import pytest
from uv_meshes import quads, rectangle, square

from obscurance import ao
from obscurance.ao.texture.uv_layout import UVLayout, page_size, texels_across, tile_ranges
from obscurance.raytrace import MemoryLimitError, MeshError, OptionError

CORNERS = [(0.2, 0.2), (0.7, 0.2), (0.2, 0.7)]


def layout(uv, wraps=True):
    return UVLayout.of(np.asarray(uv, float), (10, 20), wraps, "test")


def bent_floor(uv, size=16, **options):
    floor = rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), uv
    wall = rectangle((0, 0, 0), (0, 1, 0), (0, 0, 1)), uv + np.array([0.0, 0.5])
    mesh, coordinates = quads(floor, wall)
    return ao.bake_texture(mesh, coordinates, size, ao.Binary(), samples=64, **options)


def test_v_runs_upwards_and_rows_downwards():
    placed = layout([CORNERS]).corners[0]
    assert np.allclose(placed, [(2, 16), (7, 16), (2, 6)])


def test_the_lowest_v_is_the_last_row():
    texture = bent_floor(square(0.1, 0.05, 0.9, 0.3))
    assert texture.covered[-2].any()
    assert not texture.covered[0].any()


def test_whole_tiles_aside_is_the_same():
    moved, placed = layout(np.array([CORNERS]) + np.array([3, -2])), layout([CORNERS])
    assert np.allclose(moved.corners, placed.corners)
    assert (moved.outside, placed.outside) == (1, 0)
    uv = square(0.125, 0.0625, 0.875, 0.3125)  # so that sums are exact
    assert np.array_equal(bent_floor(uv).w, bent_floor(uv + 2).w)


def test_a_face_over_a_border_reaches_into_both_tiles():
    found = layout([[(0.8, 0.2), (1.4, 0.2), (0.8, 0.7)]])
    assert found.face.tolist() == [0, 0]
    assert np.allclose(found.corners[0] - found.corners[1], [10, 0])
    assert found.outside == 1


def test_the_whole_square_is_one_tile():
    assert layout([[(0, 0), (1, 0), (1, 1)]]).outside == 0


def test_without_wrapping_what_is_outside_is_left_out():
    assert layout([CORNERS, np.array(CORNERS) + 1], wraps=False).face.tolist() == [0]


def test_faces_turned_over_or_without_area_are_counted():
    found = layout([CORNERS, CORNERS[::-1], [(0.5, 0.5)] * 3, [(0, 0), (0.5, 0.5), (1, 1)]])
    assert (found.mirrored, found.flat) == (1, 2)
    assert found.face.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("uv", "words"),
    [
        ([[(0.5, 0.5)] * 3], "faces with an area on the page, got none"),
        ([[(0, 0), (100, 0), (0, 100)]], "at most 64 tiles, got 100"),
    ],
)
def test_what_cannot_be_laid_out(uv, words):
    with pytest.raises(MeshError, match=words):
        layout(uv)


def test_nothing_in_the_unit_square():
    with pytest.raises(MeshError, match="got none in the unit square"):
        layout(np.array([CORNERS]) + 5, wraps=False)


def test_sizes():
    assert page_size(7) == (7, 7)
    assert page_size((3, 5)) == (3, 5)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e6])
def test_coordinates_that_are_no_places(bad):
    uv = square(0.1, 0.1, 0.4, 0.4)
    uv[2, 0] = bad
    with pytest.raises(
        MeshError, match=r"texture coordinates of face 0: expected finite numbers up to 100000, got .*4 such"
    ):
        bent_floor(uv)


@pytest.mark.parametrize("uv", [np.zeros((3, 2)), np.zeros((8, 3)), "none", None, [[1, 2], [3]]])
def test_coordinates_of_another_shape(uv):
    mesh, _ = quads((rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), square(0, 0, 1, 1)))
    with pytest.raises(MeshError, match=r"expected shape \(4, 2\), by vertex, or \(2, 3, 2\)"):
        ao.bake_texture(mesh, uv)


def test_by_vertex_and_by_corner_are_the_same():
    mesh, uv = quads((rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), square(0, 0, 1, 1)))
    one, other = (ao.bake_texture(mesh, each, 8, samples=8) for each in (uv, uv[mesh.faces]))
    assert np.array_equal(one.w, other.w)


@pytest.mark.parametrize(
    ("low", "high", "tiles"),
    [
        (0, 1e-6, (0, 1)),
        (0.999999, 1, (0, 1)),
        (0.9999995, 1.0000005, (0, 2)),
        (-1e-7, 1 + 1e-7, (0, 1)),
        (1, 2, (1, 2)),
    ],
)
def test_the_tiles_that_a_face_reaches_into(low, high, tiles):
    first, last = tile_ranges(np.array([[(low, 0.1), (high, 0.1), (low, 0.9)]]))
    assert (first[0, 0], last[0, 0]) == tiles


def test_the_size_for_a_texel_size():
    uv = np.array([CORNERS])
    area = 0.125 * 4.0  # twice as long in space as on the page
    assert texels_across(uv, np.array([area]), 2.0 / 256) == 256
    assert texels_across(uv, np.array([area]), 1.99 / 256) == 512
    with pytest.raises(OptionError, match=r"at least 0\.000122"):
        texels_across(uv, np.array([area]), 1e-5)
    with pytest.raises(OptionError, match="a length above 0"):
        texels_across(uv, np.array([area]), 0.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"overlap": "darkest"}, "one of mean, first, refuse"),
        ({"interior": "mark"}, "does not go with a texture"),
        ({"size": 0}, "from 1 to 16384"),
        ({"samples": 0}, "from 1 to 1048576"),
    ],
)
def test_options_that_cannot_be(options, words):
    mesh, uv = quads((rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), square(0, 0, 1, 1)))
    with pytest.raises(OptionError, match=words):
        ao.bake_texture(mesh, uv, **options)


def test_overlaps_are_refused_when_asked():
    mesh, uv = quads(
        (rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), square(0, 0, 1, 1)),
        (rectangle((0, 0, 1), (1, 0, 0), (0, 1, 0)), square(0, 0, 1, 1)),
    )
    with pytest.raises(OptionError, match="faces that do not overlap on the page, got 64 texels"):
        ao.bake_texture(mesh, uv, 8, overlap="refuse")
    below, above = (ao.bake_texture(mesh, uv, 8, ao.Binary(), samples=64, overlap=how) for how in ("first", "mean"))
    assert below.facts.overlapping == above.facts.overlapping == 64
    assert below.w.mean() < above.w.mean() - 0.05  # the lower sheet alone, and the mean with the open upper one


def test_more_texels_than_memory_holds(available_memory):
    available_memory(1 << 30)
    mesh, uv = quads((rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), square(0, 0, 1, 1)))
    with pytest.raises(MemoryLimitError, match=r"about 29.4 GiB to bake 67,108,864 texels of 2 faces"):
        ao.bake_texture(mesh, uv, 8192, samples=256)
