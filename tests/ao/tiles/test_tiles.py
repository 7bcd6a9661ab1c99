"""Tiles: the bits of the whole bake, whatever lies at their borders, and whatever is in reach across them."""

import numpy as np
import pytest
from meshes import crumpled, hills, soup_over_floor, two_boxes
from tiled_meshes import Arrays

import ao
import ao.tiles.source
import ao.tiles.tiling
from ao.tiles.bake_tiled import bake_tiled
from raytrace import MemoryLimitError, Mesh, MeshError, OptionError


def soup(part):
    vertices, faces = part
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def with_oddities(part):
    """Also a vertex far away that nothing uses, faces without area, and a doubled one."""
    vertices, faces = part
    odd = [[0, 0, 5], [5, 5, 5], faces[0], faces[-1]]
    return np.append(vertices, [[1.3, 1.2, -1.1]], axis=0), np.concatenate([faces, odd])


PARTS = {
    "hills": hills(40),
    "hills as a soup": soup(hills(20)),
    "crumpled": crumpled(hills(30), 0.5, 1),
    "folded everywhere": crumpled(hills(20), 2.0, 1),
    "boxes": two_boxes(),
    "soup over a floor": soup_over_floor(1),
    "oddities": with_oddities(hills(20)),
}
FALLOFFS = {"binary": ao.Binary("10%"), "exponential": ao.Exponential(tau=2.0, max_distance="30%")}
FIXED = {"denoise": False, "interior": "ignore"}


@pytest.mark.parametrize("falloff", FALLOFFS)
@pytest.mark.parametrize("name", PARTS)
def test_tiles_make_the_bits_of_the_whole_bake(tmp_path, monkeypatch, name, falloff):
    monkeypatch.setattr(ao.tiles.source, "RUN", 501)
    whole = ao.bake(Mesh(*PARTS[name]), FALLOFFS[falloff], samples=32, **FIXED)
    for grid in ((1, 1, 1), (2, 2, 2), (3, 1, 2)):
        scratch = tmp_path / str(grid)
        scratch.mkdir()
        tiled = bake_tiled(Arrays(*PARTS[name]), scratch, grid, FALLOFFS[falloff], 32)
        np.testing.assert_array_equal(tiled.w, whole.w)
        assert tiled.tiles <= np.prod(grid)
        assert tiled.halo >= 0


@pytest.mark.parametrize(
    "options",
    [{"samples": 600}, {"seed": 5}, {"normals": "area"}, {"traversal": "embree"}, {"threads": 1}, {"spread": 70}],
    ids=str,
)
def test_options_are_those_of_the_whole_bake(tmp_path, options):
    options = {"samples": 32} | options
    whole = ao.bake(Mesh(*PARTS["crumpled"]), FALLOFFS["binary"], **options, **FIXED)
    tiled = bake_tiled(Arrays(*PARTS["crumpled"]), tmp_path, (2, 2, 1), FALLOFFS["binary"], **options)
    np.testing.assert_array_equal(tiled.w, whole.w)


def test_walls_are_traced_as_by_the_whole_bake(tmp_path):
    """Of walls few rays go through Embree: the tiles agree on that by points all over the mesh."""
    vertices, faces = hills(20)
    floor = vertices * [1, 1, 0]
    ceiling = floor + np.array([0, 0, 0.05])
    part = np.concatenate([floor, ceiling]), np.concatenate([faces, faces[:, ::-1] + len(floor)])
    falloff = ao.Exponential(tau=2.0, max_distance="80%")
    whole = ao.bake(Mesh(*part), falloff, samples=32, **FIXED)
    assert whole.w.mean() < 0.5
    np.testing.assert_array_equal(ao.bake(Mesh(*part), falloff, samples=32, traversal="embree", **FIXED).w, whole.w)
    np.testing.assert_array_equal(bake_tiled(Arrays(*part), tmp_path, (2, 2, 2), falloff, 32).w, whole.w)


def test_a_flat_mesh_with_an_unused_vertex_below_it(tmp_path):
    part = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.5, -1]], [[0, 1, 2]]
    assert bake_tiled(Arrays(*part), tmp_path, (2, 2, 2), FALLOFFS["binary"], 32).w.min() == 1


def test_a_halo_too_narrow_is_noticed(tmp_path, monkeypatch):
    """The test of the tests above: without what is in reach, w is another."""
    extract = ao.tiles.tiling.extract_tile
    short = lambda tiling, tile, reach, origins: extract(tiling, tile, 0.0, origins)  # noqa: E731
    monkeypatch.setattr("ao.tiles.bake_tiled.extract_tile", short)
    whole = ao.bake(Mesh(*PARTS["hills"]), FALLOFFS["exponential"], samples=32, **FIXED)
    tiled = bake_tiled(Arrays(*PARTS["hills"]), tmp_path, (2, 2, 2), FALLOFFS["exponential"], 32)
    assert (tiled.w != whole.w).any()


def test_a_tile_that_does_not_fit_is_refused_in_a_line(tmp_path, monkeypatch):
    monkeypatch.setattr("raytrace.system.checks.available", lambda: 1 << 20)
    with pytest.raises(MemoryLimitError, match=r"arrays: memory: expected .* for a tile of .*; more tiles are smaller"):
        bake_tiled(Arrays(*hills(8)), tmp_path, falloff=FALLOFFS["binary"])


def test_mistakes_are_refused(tmp_path):
    source = Arrays(*hills(8))
    with pytest.raises(OptionError, match="max_distance: expected a finite distance"):
        bake_tiled(source, tmp_path, falloff="binary")
    with pytest.raises(OptionError, match="normals: expected angle, area or equal"):
        bake_tiled(source, tmp_path, falloff=FALLOFFS["binary"], normals="file")
    with pytest.raises(MeshError, match=r"arrays: faces\[1\]: expected indices from 0 to 63"):
        bake_tiled(Arrays(hills(8)[0], [[0, 1, 2], [1, 2, 64]]), tmp_path, falloff=FALLOFFS["binary"])
    bad = hills(8)[0].copy()
    bad[7, 1] = np.nan
    with pytest.raises(MeshError, match=r"arrays: vertices\[7\]: expected finite coordinates"):
        bake_tiled(Arrays(bad, hills(8)[1]), tmp_path, falloff=FALLOFFS["binary"])
