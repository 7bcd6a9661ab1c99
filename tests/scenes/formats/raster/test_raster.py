"""Sky-view factors of terrain against closed forms, and what rasters keep."""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command import obscurance, refused, succeeded
from pages import columns_of, facts_of

import obscurance as package
from obscurance import scenes
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.formats.raster import stored_columns, with_sides

rasterio = pytest.importorskip("rasterio")
from rasterio.enums import ColorInterp  # noqa: E402
from rasterio.transform import Affine  # noqa: E402

BETA = np.radians(35)
LONG = 400.0  # cells along a valley, of the unit across, so that it is as good as endless
NOWHERE = -9999.0


def write(path, heights, across=1.0, along=1.0, crs="EPSG:32632", west=5e5, **more):
    """A raster whose rows go southwards from (5e5, 5e6)."""
    form = {"driver": "GTiff", "dtype": "float32", "nodata": NOWHERE, "count": 1, "crs": crs} | more
    place = {"transform": Affine(across, 0, west, 0, -along, 5e6)}
    size = {"height": heights.shape[0], "width": heights.shape[1]}
    with rasterio.open(path, "w", **form, **place, **size) as file:
        file.write(heights.astype(form["dtype"]), 1)


def sky(path, *options):
    """w of the cells, and its standard errors."""
    target = path.with_name("sky.tif")
    succeeded("bake", path, "-o", target, "--falloff", "binary", "--tolerance", 0.004, "-q", *options)
    with rasterio.open(target) as file:
        assert file.descriptions == ("obscurance", "standard error")
        return file.read(1), file.read(2)


def valley(columns, profile):
    """41 rows of a cross-section, a function of the distance from the middle."""
    middle = (columns - 1) / 2
    return np.tile(profile(np.abs(np.arange(columns) - middle)), (41, 1))


def test_a_v_valley(tmp_path):
    """A strip seen between angles a and b from the normal has the factor (sin b − sin a)/2; at the bottom cos β is left
    of the sky of a horizontal cell."""
    columns = 81
    write(tmp_path / "v.tif", valley(columns, lambda x: x * np.tan(BETA)), along=LONG)
    w, _ = sky(tmp_path / "v.tif", "--normals", "up")
    assert abs(w[20, 40] - np.cos(BETA)) < 0.02
    w, _ = sky(tmp_path / "v.tif")  # of the inclined surface
    x = np.arange(10, 30)  # cells of the left flank, from its rim
    foot = (40 - x) / np.cos(BETA)  # metres along it down to the bottom
    far = 40 / np.cos(BETA)  # the length of the other flank
    along = foot + far * np.cos(2 * BETA)  # to the other rim, in the frame of the flank
    exact = 1 - (1 - along / np.hypot(along, far * np.sin(2 * BETA))) / 2
    assert np.abs(w[20, 10:30] - exact).max() < 0.02


def horizons(heights, cell, azimuths):
    """Tangents (cells, azimuths) of the horizon's elevation, by the profile of the surface towards each azimuth: its
    highest points are over edges, of rows, of columns and of the diagonals of cells; −∞ where none is."""
    rows, columns = (index.ravel()[:, None, None] for index in np.indices(heights.shape))
    down, right = -np.cos(azimuths)[:, None], np.sin(azimuths)[:, None]
    line = np.arange(1 - max(heights.shape), max(heights.shape))
    start = heights.ravel()[:, None, None]
    size = np.array(heights.shape) - 1
    highest = np.full((heights.size, len(azimuths)), -np.inf)
    for steps in ((line - rows) / down, (line - columns) / right, (line - rows + columns) / (down - right)):
        r, c = rows + steps * down, columns + steps * right
        inside = [np.abs(2 * at - most) < most + 1e-9 for at, most in zip((r, c), size, strict=True)]
        within = (steps > 1e-9) & inside[0] & inside[1]
        r0, c0 = (np.clip(np.floor(at), 0, None).astype(int) for at in (np.where(within, r, 0), np.where(within, c, 0)))
        r1, c1 = np.minimum(r0 + 1, heights.shape[0] - 1), np.minimum(c0 + 1, heights.shape[1] - 1)
        u, v = np.where(within, r - r0, 0), np.where(within, c - c0, 0)
        flat = heights[r0, c0] * (1 - np.maximum(u, v)) + heights[r1, c1] * np.minimum(u, v)
        met = flat + heights[r1, c0] * np.maximum(u - v, 0) + heights[r0, c1] * np.maximum(v - u, 0)
        rise = (met - start) / (cell * np.where(within, steps, 1))
        highest = np.maximum(highest, np.where(within, rise, -np.inf).max(axis=2))
    return highest


def factors(tangents, azimuths, normals):
    """Sky-view factors of surfaces with `normals` (cells, 3), x east and y north, by the integral over azimuths of
    Steger et al. 2022: (1/2π) ∫ (n_x sin φ + n_y cos φ)(π/2 − h − sin h cos h) + n_z cos² h dφ, h not below the
    surface."""
    aside = normals[:, :1] * np.sin(azimuths) + normals[:, 1:2] * np.cos(azimuths)
    h = np.arctan(np.maximum(tangents, -aside / normals[:, 2:]))
    return np.mean(aside * (np.pi / 2 - h - np.sin(h) * np.cos(h)) + normals[:, 2:] * np.cos(h) ** 2, axis=1)


@cache
def steep_hills(size, cell):
    """Heights of a raster of cells, azimuths and the tangents of its horizons."""
    rng = np.random.default_rng(8)
    waves = [np.sin(np.add.outer(a * np.arange(size), b * np.arange(size)) + c) for a, b, c in rng.normal(size=(9, 3))]
    heights = (cell * np.sum(waves, axis=0)).astype(np.float32).astype(np.float64)
    azimuths = np.radians(np.arange(360) + 0.37)
    return heights, azimuths, horizons(heights, cell, azimuths)


@pytest.mark.parametrize("steepness", [0.25, 1.0])
def test_all_definitions_are_the_integrals_of_the_horizon(tmp_path, steepness):
    """Steep cells, up to 82°, have folds, where w of the inclined surface is a mean over its faces and no integral. At
    the border a cell has its own slope as horizon."""
    size, cell = 15, 30.0
    steepest, azimuths, tangents = steep_hills(size, cell)
    heights, tangents = steepness * steepest, steepness * tangents  # a power of two changes no other digit
    write(tmp_path / "hills.tif", heights, cell, cell)
    row, column = (index.ravel() for index in np.indices(heights.shape))
    number = np.arange(size * size).reshape(size, size)
    a, b, c, d = (n.ravel() for n in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    places = np.stack([cell * column, -cell * row, heights.ravel()], axis=1)
    sloping = np.asarray(trimesh.Trimesh(places, faces, process=False).vertex_normals)
    up = np.tile([0.0, 0.0, 1.0], (size * size, 1))
    inclined, horizontal = factors(tangents, azimuths, sloping), factors(tangents, azimuths, up)
    visible = 1 - np.sin(np.arctan(np.maximum(tangents, 0))).mean(axis=1)  # Zakšek et al. 2011
    up_alone = "--normals", "up"
    cases = [(horizontal, inclined, up_alone), (visible, horizontal, (*up_alone, "--weight", "uniform"))]
    for exact, other, options in (*cases, *([(inclined, horizontal, ())] if steepness < 1 else [])):
        inner = (np.minimum(row, column) > 0) & (np.maximum(row, column) < size - 1)
        w, exact, other = sky(tmp_path / "hills.tif", *options)[0].ravel()[inner], exact[inner], other[inner]
        assert np.sqrt(np.mean((w - exact) ** 2)) < 0.004
        assert np.abs(w - exact).max() < 0.02
        assert np.sqrt(np.mean((w - other) ** 2)) > 0.02


STORED = {
    "feet": (1 / 0.3048, "float32", {"units": ("ft",)}, "heights are in ft and taken to metres"),
    "US feet": (3937 / 1200, "float32", {"units": ("US survey foot",)}, "heights are in US survey foot and taken to"),
    "a vertical system": (3937 / 1200, "float32", {"crs": "EPSG:32632+6360"}, "heights are in US survey foot"),
    "decimetres": (10, "int16", {"scales": (0.1,)}, ""),
    "an offset": (100, "int16", {"scales": (0.01,), "offsets": (500.0,)}, ""),
    "kilometres": (0.001, "float64", {"units": ("km",)}, "heights are in km and taken to metres"),
    "a unit unknown": (1, "float32", {"units": ("hPa",)}, "heights are in hPa, which is taken for metres"),
    "no system": (1, "float32", {"crs": None}, "it names no reference system: cells are taken for metres"),
}  # fmt: skip


@pytest.mark.parametrize("name", STORED)
def test_heights_are_those_that_a_file_stands_for(tmp_path, name):
    factor, dtype, facts, said = STORED[name]
    heights = np.round(valley(41, lambda x: x * np.tan(BETA)), 2)
    write(tmp_path / "metres.tif", heights)
    system = facts.get("crs", "EPSG:32632")
    write(tmp_path / "stored.tif", np.round(factor * heights, 5), dtype=dtype, crs=system)
    with rasterio.open(tmp_path / "stored.tif", "r+") as file:
        for fact in facts.keys() - {"crs"}:
            setattr(file, fact, facts[fact])
    files = {each: scenes.load(tmp_path / f"{each}.tif") for each in ("metres", "stored")}
    metres, stored = (file.mesh.vertices - file.mesh.vertices[0] for file in files.values())
    np.testing.assert_allclose(stored, metres, atol=0.06 if dtype == "int16" and factor == 10 else 2e-3)
    assert [said in note for note in files["stored"].notes] == [True] * bool(said)
    assert files["metres"].notes == ()
    done = obscurance("bake", tmp_path / "stored.tif", "-o", tmp_path / "sky.tif", "--samples", 8)
    assert done.stderr.count("\n") == bool(said) + ("between the vertices" in done.stderr)


VOIDS = [("int16", -32768), ("float32", -3.4028235e38), ("float32", 3.4e38), ("int16", -9999), ("float64", -9999)]


@pytest.mark.parametrize(("dtype", "void"), VOIDS)
def test_voids_that_no_tag_names_are_gaps(tmp_path, dtype, void):
    heights = np.arange(30.0).reshape(5, 6)
    heights[2, 3] = void
    write(tmp_path / "void.tif", heights, dtype=dtype, nodata=None)
    done = obscurance("bake", tmp_path / "void.tif", "-o", tmp_path / "sky.tif", "--samples", 8)
    assert "void.tif: 1 cells of " in done.stderr
    assert "which no tag names, are taken for gaps" in done.stderr
    with rasterio.open(tmp_path / "sky.tif") as file:
        np.testing.assert_array_equal(file.read(1) == NOWHERE, heights == void)


def test_the_sea_may_be_as_deep_as_a_void(tmp_path):
    heights = -9999.0 + np.abs(np.arange(30.0).reshape(5, 6) - 12)
    write(tmp_path / "trench.tif", heights, dtype="int16", nodata=None)
    assert scenes.load(tmp_path / "trench.tif").mesh.vertices[:, 2].min() == -9999


def test_an_ascii_grid_has_the_system_beside_it(tmp_path):
    """Else feet and degrees would be taken for metres."""
    (tmp_path / "g.asc").write_text("ncols 4\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 3\n" + "1 4 2 8\n" * 3)
    beside = tmp_path / "g.prj"
    metres = scenes.load(tmp_path / "g.asc")
    (unnamed,) = metres.notes
    assert unnamed.endswith("g.asc: it names no reference system: cells are taken for metres")
    beside.write_text(rasterio.crs.CRS.from_epsg(2263).to_wkt(version="WKT1_ESRI"))
    feet = scenes.load(tmp_path / "g.asc")
    (told,) = feet.notes
    assert told.endswith("cells are in US survey foot, heights, of which no unit is named, are taken for metres")
    np.testing.assert_allclose(feet.mesh.vertices, metres.mesh.vertices * [1200 / 3937, 1200 / 3937, 1])
    succeeded("bake", tmp_path / "g.asc", "-o", tmp_path / "sky.tif", "--samples", 8)
    with rasterio.open(tmp_path / "sky.tif") as file:
        assert file.crs.linear_units == "US survey foot"
    beside.write_text(rasterio.crs.CRS.from_epsg(4326).to_wkt())
    refused(obscurance("info", tmp_path / "g.asc"), "g.asc: reference system", "degrees, EPSG:4326")
    beside.write_text("Projection UTM\nZone 32\n")  # of ArcInfo's own
    assert scenes.load(tmp_path / "g.asc").notes == (unnamed,)


def test_of_several_bands_one_is_asked_for_and_alpha_is_none(tmp_path):
    heights = np.arange(30.0).reshape(5, 6)
    write(tmp_path / "two.tif", heights, count=2, nodata=None)
    line = "-o", tmp_path / "sky.tif", "--samples", 8
    said = "bands: expected one, of heights: gdal_translate -b 1 takes the first, got 2"
    refused(obscurance("bake", tmp_path / "two.tif", *line), said)
    write(tmp_path / "two.tif", heights, count=2, nodata=None, dtype="uint16")
    with rasterio.open(tmp_path / "two.tif", "r+") as file:
        file.colorinterp = ColorInterp.gray, ColorInterp.alpha
        file.write(np.where(heights == 8, 0, 255).astype("uint16"), 2)
    succeeded("bake", tmp_path / "two.tif", *line)
    with rasterio.open(tmp_path / "sky.tif") as file:
        np.testing.assert_array_equal(file.read(1) == NOWHERE, heights == 8)


NEAR = [
    (1 / 3600, (-104.3, 39.5), True),
    (0.01, (179.0, -89.0), True),
    (0.01, (500.0, 20.0), False),
    (0.1, (9.0, 46.0), False),
]


@pytest.mark.parametrize(("cell", "corner", "is_refused"), NEAR)
def test_degrees_are_known_without_a_reference_system(tmp_path, cell, corner, is_refused):
    head = f"ncols 5\nnrows 3\nxllcorner {corner[0]}\nyllcorner {corner[1]}\ncellsize {cell}\nNODATA_value -9999\n"
    (tmp_path / "d.asc").write_text(head + "0 1 2 3 4\n" * 3)
    done = obscurance("bake", tmp_path / "d.asc", "-o", tmp_path / "w.npy", "--samples", 8)
    if is_refused:
        refused(
            done, "reference system: expected cells in a unit of length: gdalwarp -s_srs EPSG:4326 -t_srs EPSG:326NN"
        )
    else:
        assert done.returncode == 0


@pytest.mark.parametrize("system", ["EPSG:32632", "EPSG:2263"])
def test_occluders_lie_where_their_coordinates_are(tmp_path, system):
    """A terrace east of a plain: one raster, two rasters, or a raster and a wall in coordinates of the system."""
    heights = np.where(np.arange(60) < 30, 0.0, 15.0) + np.zeros((31, 1))
    write(tmp_path / "whole.tif", heights, crs=system)
    write(tmp_path / "plain.tif", heights[:, :30], crs=system)
    write(tmp_path / "terrace.tif", heights[:, 30:], crs=system, west=5e5 + 30)
    unit = rasterio.crs.CRS.from_string(system).linear_units_factor[1]
    x, y = 5e5 + 30.5, (5e6 - 0.5, 5e6 - 30.5)
    corners = [(x, y[0], -1), (x, y[1], -1), (x, y[1], 15 / unit), (x, y[0], 15 / unit)]
    lines = [f"v {a} {b} {c}" for a, b, c in corners]
    (tmp_path / "wall.obj").write_text("\n".join([*lines, "f 1 2 3 4"]))
    options = "--normals", "up", "--no-denoise", "--samples", 2048
    found = {}
    for name, occluder in {"whole": None, "plain": None, "beside": "terrace.tif", "behind": "wall.obj"}.items():
        path = tmp_path / ("whole.tif" if name == "whole" else "plain.tif")
        line = ["--occluder", tmp_path / occluder] if occluder else []
        succeeded("bake", path, "-o", tmp_path / "w.npy", "--falloff", "binary", *options, *line)
        found[name] = np.load(tmp_path / "w.npy").reshape(31, -1)[15, :29]
    plain, terrace = (scenes.load(tmp_path / name) for name in ("plain.tif", "terrace.tif"))
    moved = replace(terrace.mesh, vertices=terrace.mesh.vertices + np.array([30 * unit, 0, 0]))  # beside the plain's
    arrays = with_sides(moved, 0.0)
    given = {"falloff": "binary", "normals": "up", "denoise": False, "samples": 2048}
    w = [package.bake(plain, occluder=each, **given).w.reshape(31, -1)[15, :29] for each in (terrace, arrays)]
    np.testing.assert_allclose(w, [found["beside"]] * 2, atol=1e-3)
    assert found["plain"].min() == 1
    assert found["whole"][0] - found["whole"][-1] > 0.3
    np.testing.assert_allclose(found["beside"], found["whole"], atol=0.015)
    np.testing.assert_allclose(found["behind"], found["whole"], atol=0.03)


def test_a_raster_occludes_a_mesh_in_its_coordinates_and_one_elsewhere_is_told(tmp_path):
    write(tmp_path / "roof.tif", np.full((9, 9), 2.0))
    lines = [f"v {5e5 + x} {5e6 - y} 0" for x, y in ((4, 4), (4, 5), (5, 5), (5, 4))]
    (tmp_path / "floor.obj").write_text("\n".join([*lines, "f 1 2 3 4"]))
    line = "-o", tmp_path / "w.npy", "--falloff", "binary", "--samples", 1024, "--occluder", tmp_path / "roof.tif"
    done = succeeded("bake", tmp_path / "floor.obj", *line)
    assert np.load(tmp_path / "w.npy").max() < 0.05  # terrain is solid: its sides reach down to the floor
    assert "away" not in done.stderr
    (tmp_path / "floor.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n")
    assert "roof.tif: it lies " in obscurance("bake", tmp_path / "floor.obj", *line).stderr


def test_a_plane_is_open_and_the_grid_is_kept(tmp_path):
    heights = np.add.outer(np.arange(30.0), 0.5 * np.arange(20))
    heights[3, 4] = NOWHERE
    heights[7, 8] = np.nan
    write(tmp_path / "plane.tif", heights, 10.0, 10.0)
    w, error = sky(tmp_path / "plane.tif", "--max-distance", "10km")
    gone = np.zeros(heights.shape, np.bool_)
    gone[[3, 7], [4, 8]] = True
    assert (w[gone] == NOWHERE).all()
    assert (error[gone] == NOWHERE).all()
    assert (w[~gone] == 1).all()
    with rasterio.open(tmp_path / "plane.tif") as before, rasterio.open(tmp_path / "sky.tif") as after:
        assert before.crs == after.crs
        assert before.transform == after.transform
        assert after.nodata == NOWHERE


def test_other_units_and_grids_give_the_same(tmp_path):
    """Feet across, rows that go northwards, an Esri ASCII grid: the same w."""
    heights = np.sin(np.add.outer(np.arange(24.0), np.arange(24.0) / 2) / 3) / 3
    write(tmp_path / "metres.tif", heights, 1200 / 3937, 1200 / 3937)
    expected, _ = sky(tmp_path / "metres.tif")
    write(tmp_path / "feet.tif", heights, crs="EPSG:2263")
    assert np.abs(sky(tmp_path / "feet.tif")[0] - expected).max() < 1e-3
    write(tmp_path / "north.tif", heights[::-1], 1200 / 3937, -1200 / 3937)
    assert np.abs(sky(tmp_path / "north.tif")[0][::-1] - expected).max() < 0.03
    head = f"ncols 24\nnrows 24\nxllcorner 0\nyllcorner 0\ncellsize {1200 / 3937!r}\nNODATA_value -9999\n"
    text = "\n".join(" ".join(map(repr, row.tolist())) for row in heights.astype(np.float32).astype(np.float64))
    (tmp_path / "grid.asc").write_text(head + text + "\n")
    assert np.abs(sky(tmp_path / "grid.asc")[0] - expected).max() < 1e-3


def test_what_is_refused(tmp_path):
    write(tmp_path / "degrees.tif", np.zeros((4, 4)), crs="EPSG:4326")
    refused(obscurance("bake", tmp_path / "degrees.tif", "-o", tmp_path / "w.tif"), "degrees", "gdalwarp")
    write(tmp_path / "empty.tif", np.full((4, 4), NOWHERE))
    refused(obscurance("bake", tmp_path / "empty.tif", "-o", tmp_path / "w.tif"), "cells", "none")
    (tmp_path / "cut.asc").write_text("ncols 4\nnrows 3\nxllcorner 0\nyllcorner 0\ncellsize 3\n1 2 3 4\n")
    said = "cut.asc: file: expected a readable file", "File short, can't read line 1"
    done = obscurance("bake", tmp_path / "cut.asc", "-o", tmp_path / "w.tif")
    refused(done, *said)
    assert not re.search("[0-9a-f]{8}-[0-9a-f]{4}", done.stderr)  # GDAL's name of the content
    (tmp_path / "text.tif").write_text("no raster")
    refused(obscurance("bake", tmp_path / "text.tif", "-o", tmp_path / "w.tif"), "a raster of heights")
    assert not (tmp_path / "w.tif").exists()


@pytest.mark.parametrize("options", [(), ("--method", "surface")])
@pytest.mark.parametrize("steep", [45, 75])
def test_horizontal_cells_of_a_ramp_by_either_method(tmp_path, steep, options):
    """(1 + cos β)/2, and as much between the cells."""
    write(tmp_path / "ramp.tif", np.arange(40.0) * np.tan(np.radians(steep)) + np.zeros((30, 1)))
    given = "--normals", "up", "--up", "z", "--falloff", "binary", "--report", tmp_path / "r.json", *options
    done = succeeded("bake", tmp_path / "ramp.tif", "-o", tmp_path / "w.npz", *given)
    assert "warning" not in done.stderr
    np.testing.assert_allclose(np.load(tmp_path / "w.npz")["w"], (1 + np.cos(np.radians(steep))) / 2, atol=0.02)
    assert json.loads((tmp_path / "r.json").read_text())["interpolation"]["rmse"] < 0.01


def test_what_is_up_counts_for_horizontal_hemispheres(tmp_path):
    (tmp_path / "slope.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 1\nf 1 2 3 4\n")
    for up, expected in {"z": (1 + 0.5**0.5) / 2, "x": 0.5}.items():
        options = "--normals", "up", "--up", up, "--falloff", "binary", "--samples", 4096
        succeeded("bake", tmp_path / "slope.obj", "-o", tmp_path / "w.npy", *options)
        np.testing.assert_allclose(np.load(tmp_path / "w.npy"), expected, atol=0.01)


@pytest.mark.parametrize("normals", ["file", "up"])
def test_between_cells_of_a_raster_is_nothing_to_warn_of(tmp_path, normals):
    write(tmp_path / "rough.tif", 3 * np.random.default_rng(1).normal(size=(30, 30)))
    given = "bake", tmp_path / "rough.tif", "--normals", normals, "--falloff", "binary", "-o"
    assert "between the vertices" in obscurance(*given, tmp_path / "w.npz").stderr
    assert obscurance(*given, tmp_path / "sky.tif").stderr == ""


@pytest.fixture
def hilly(tmp_path, monkeypatch):
    """A raster with a gap, and its w."""
    monkeypatch.chdir(tmp_path)
    x = np.arange(40.0)
    heights = 4 * np.add.outer(np.sin(x / 4), np.cos(x[:30] / 5))
    heights[3, 4] = NOWHERE
    write(tmp_path / "dem.tif", heights)
    succeeded("bake", "dem.tif", "-o", "sky.tif", "--falloff", "binary", "--samples", 64, "-q")
    return heights


def test_a_result_is_looked_at_on_its_terrain(hilly):
    succeeded("view", "sky.tif", "--mesh", "dem.tif", "-o", "page.html")
    with rasterio.open("sky.tif") as file:
        w, error = (file.read(band)[hilly != NOWHERE] for band in (1, 2))
    assert {*stored_columns(Path("sky.tif"), ("error", "flags"))} == {"error"}  # each band is read once
    page = Path("page.html").read_bytes()
    np.testing.assert_allclose(columns_of(page)["w0"] / 65535, w, atol=1e-5)
    assert facts_of(page)["bakes"][0]["errorTop"] == pytest.approx(error.max())
    refused(obscurance("view", "sky.tif"), "--mesh with the mesh that sky.tif belongs to")
    write(Path("other.tif"), hilly[1:])
    refused(obscurance("view", "sky.tif", "--mesh", "other.tif"), "sky.tif: w: expected 1,169 values", "got 1,199")
    assert "there is no w in it; it was baked" in obscurance("view", "dem.tif").stderr
    for line in ("info", "sky.tif"), ("bake", "sky.tif", "-o", "w.npy"), ("render", "sky.tif", "-o", "w.png"):
        refused(obscurance(*line), "sky.tif: bands: expected heights", "got those of a bake")


def test_a_picture_takes_the_result_and_is_not_white(hilly):
    small = "--width", 96, "--height", 64, "--samples", 16
    for name, source in {"sky.tif": "dem.tif", "w.npy": "dem.tif"}.items():
        if name == "w.npy":
            with rasterio.open("sky.tif") as file:
                np.save(name, file.read(1)[hilly != NOWHERE])
        succeeded("render", source, "-o", f"{name}.exr", "--baked", name, *small)
    ours, arrays = (read_image(Path(f"{name}.exr"))[0]["beauty"] for name in ("sky.tif", "w.npy"))
    np.testing.assert_array_equal(ours, arrays)
    refused(
        obscurance("render", "dem.tif", "-o", "p.png", "--baked", "dem.tif"), "a band called obscurance", "got none"
    )
    write(Path("level.tif"), np.zeros((20, 20)))
    succeeded("render", "level.tif", "-o", "level.exr", *small)
    for name in ("level.exr", "sky.tif.exr"):
        picture = read_image(Path(name))[0]["beauty"]
        shown = picture[picture[..., 3] == 1][:, :3]
        assert 0.15 < shown.mean() < 0.5
        assert np.quantile(shown, 0.99) < 0.75


@pytest.mark.parametrize("output", ["sky.tif", "sky.TIFF", "w.npy"])
def test_a_profile_needs_a_file_that_holds_one(hilly, output):
    refused(obscurance("bake", "dem.tif", "-o", output, "--profile"), "--profile needs an output that holds one: .npz")
    refused(
        obscurance("falloff", "sky.tif", "--half-distance", "5%", "-o", "w.npy"), "ending in .exr or .glb", "sky.tif"
    )


def test_ground_control_points_and_complex_numbers_are_no_grid_of_heights(tmp_path):
    """Their cells would be taken for squares of a metre, and their real parts for heights."""
    heights = np.arange(30.0).reshape(5, 6)
    write(tmp_path / "gcps.tif", heights, crs=None)
    corners = [(0, 0, 5e5, 5e6), (0, 6, 500012, 5e6), (5, 0, 5e5, 4999990)]
    with rasterio.open(tmp_path / "gcps.tif", "r+") as file:
        file.gcps = [rasterio.control.GroundControlPoint(*corner) for corner in corners], "EPSG:32632"
    refused(obscurance("info", tmp_path / "gcps.tif"), "gdalwarp makes one of ground control points, got 3 of these")
    write(tmp_path / "complex.tif", heights, dtype="complex64")
    refused(obscurance("info", tmp_path / "complex.tif"), "expected one, of real numbers, got complex64")


@pytest.mark.parametrize(("latitude", "said"), [(0.0, ""), (60.0, "cells of Web Mercator are 2 times as wide as the")])
def test_cells_that_are_wider_than_the_ground_are_warned_of(tmp_path, latitude, said):
    north = 6378137.0 * np.arcsinh(np.tan(np.radians(latitude)))
    write(tmp_path / "tile.tif", np.arange(30.0).reshape(5, 6), crs="EPSG:3857")
    with rasterio.open(tmp_path / "tile.tif", "r+") as file:
        file.transform = Affine(2, 0, 0, 0, -2, north)
    assert [said in note for note in scenes.load(tmp_path / "tile.tif").notes] == [True] * bool(said)
