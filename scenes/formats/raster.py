"""Height rasters by rasterio (GDAL), GeoTIFF and Esri ASCII grids: terrain in, w of every cell out.

A vertex is at the centre of every cell that has data, two triangles are between four. Cells are taken to metres, by the
unit of the reference system, from the corner of the raster; heights by their scale, offset and unit, which GDAL finds
in a vertical reference system, too.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Container
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from obscurance.ao import Bake
from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.types import Bools, Float64s

from ..asset.asset import Asset
from ..asset.primitive import Primitive
from .load import parser_errors
from .table import Channels, MeshInput, format_of, is_raster

if TYPE_CHECKING:
    from rasterio.crs import CRS
    from rasterio.io import DatasetReader

_DRIVERS = {".asc": "AAIGrid", ".tif": "GTiff", ".tiff": "GTiff"}  # others of GDAL open what a content names
_IN_MEMORY = re.compile(r"\S*[0-9a-f-]{36}\.tif[:,]? *")  # GDAL's name of the content
_US_FOOT = 1200 / 3937
_UNITS = {"km": 1000.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "foot": 0.3048, "feet": 0.3048} | (
    dict.fromkeys(("us survey foot", "us survey feet", "us-ft", "ft-us", "ftus", "foot_us"), _US_FOOT)
)
_METRES = "", "m", "metre", "metres", "meter", "meters"
_VOID, _HUGE = -32768.0, 1e30  # heights that no tag need name: of SRTM, and of float32 below ±3.4e38
_CUSTOM, _DEEP = -9999.0, -9000.0  # another, unless there are other heights as deep: of trenches of the sea
_DEGREES, _AROUND = 0.05, 360.0  # cells smaller than that, with corners within that, are in degrees
_WEB_MERCATOR, _EARTH = 3857, 6378137.0  # EPSG's number, and the radius of its sphere, metres
_STRETCHED = 1.02  # times true lengths, that make slopes wrong
_CELL = 240  # bytes of memory a cell takes until it is a vertex and two triangles
_PACKED, _FEW = 1100, 1 << 20  # cells that a byte of file holds at most; so many that any file may have
_NO_DATA = _CUSTOM
_PROJECTION = 1 << 16  # characters of a reference system
_KEPT = "width", "height", "transform"
_RECORD = "OBSCURANCE_BAKE"  # a tag: how w was baked
_BANDS = {"obscurance": "w", "standard error": "error"}  # of a result, and what is in them


def read_raster(mesh_input: MeshInput) -> Asset:
    """The surface through the cells of the first band, z upwards.

    Raises:
        MeshError: no cell has data, cells are in degrees, or there are several bands, or those of a bake. Others as
            `opened`.
    """
    with opened(mesh_input.file, mesh_input.source) as raster:
        from rasterio.enums import MaskFlags

        if raster.descriptions[0] in _BANDS:
            expected = "heights: view and render take w beside the raster that was baked, as --mesh and --baked"
            raise MeshError(mesh_input.source, "bands", expected, "those of a bake")
        if raster.count > 1 and MaskFlags.alpha not in raster.mask_flag_enums[0]:
            expected = "one, of heights: gdal_translate -b 1 takes the first"
            raise MeshError(mesh_input.source, "bands", expected, raster.count)
        if raster.dtypes[0].startswith("complex"):
            raise MeshError(mesh_input.source, "bands", "one, of real numbers", raster.dtypes[0])
        if raster.gcps[0]:
            expected = "cells in a grid: gdalwarp makes one of ground control points"
            raise MeshError(mesh_input.source, "reference system", expected, f"{len(raster.gcps[0])} of these")
        heights, has_data, notes = cells_of(raster)
        transform = raster.transform
        system = _system_of(raster, mesh_input.path)
        unit = _unit_of(raster, system, mesh_input.source)
        if not system:
            notes += ("it names no reference system: cells are taken for metres",)
        elif system.to_epsg() == _WEB_MERCATOR:
            stretched = np.cosh((raster.bounds.top + raster.bounds.bottom) / 2 / _EARTH)
            if stretched > _STRETCHED:
                makes = "gdalwarp -t_srs EPSG:326NN, for UTM, makes such of true size"
                notes += (f"cells of Web Mercator are {stretched:.3g} times as wide as the ground: {makes}",)
        elif unit != 1 and not raster.units[0]:
            notes += (f"cells are in {system.linear_units}, heights, of which no unit is named, are taken for metres",)
    if not has_data.any():
        raise MeshError(mesh_input.source, "cells", "some with data", "none")
    cell_rows, cell_columns = np.nonzero(has_data)
    x = transform.a * (cell_columns + 0.5) + transform.b * (cell_rows + 0.5)
    y = transform.d * (cell_columns + 0.5) + transform.e * (cell_rows + 0.5)
    vertices = np.stack([unit * x, unit * y, heights[has_data]], axis=1)
    number = np.full(heights.shape, -1)
    number[has_data] = np.arange(len(vertices))
    corners = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    faces = faces[(faces >= 0).all(axis=1)]
    if transform.determinant > 0:  # rows go northwards
        faces = faces[:, ::-1]
    to_system = np.diag([1 / unit, 1 / unit, 1 / unit, 1.0])
    to_system[:2, 3] = transform.c, transform.f
    surface = Primitive.of(vertices, faces.ravel())
    return Asset.single(mesh_input.path, mesh_input.name, surface, notes, up="z", to_system=to_system)


def with_sides(mesh: Mesh, low: float) -> Mesh:
    """Terrain, a surface z of x and y, as solid: with vertical sides from its borders down to z = `low`, or lower."""
    low = min(low, float(mesh.vertices[:, 2].min()))
    count = len(mesh.vertices)
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    border = edges[~np.isin(edges @ [count, 1], edges[:, ::-1] @ [count, 1])]  # those of one face
    foot = np.unique(border)
    below = mesh.vertices[foot] * [1, 1, 0] + [0, 0, low]
    a, b = border.T
    down_a, down_b = count + np.searchsorted(foot, border).T
    sides = np.concatenate([np.stack([a, down_a, b], axis=1), np.stack([b, down_a, down_b], axis=1)])
    return Mesh(
        np.concatenate([mesh.vertices, below]), np.concatenate([mesh.faces, sides]), source=mesh.source, up=mesh.up
    )


def _system_of(raster: DatasetReader, path: Path) -> CRS | None:
    """The reference system of a raster, of an ASCII grid that in the .prj beside it; None: none that GDAL reads."""
    beside = path.with_suffix(".prj")
    if raster.crs or path.suffix.lower() != ".asc" or not beside.is_file():
        return raster.crs
    from rasterio.crs import CRS
    from rasterio.errors import CRSError

    with beside.open(encoding="utf-8", errors="replace") as file, suppress(CRSError):
        return CRS.from_wkt(file.read(_PROJECTION))
    return None


def _unit_of(raster: DatasetReader, system: CRS | None, source: str) -> float:
    """The unit of the cells' places in metres. Raises: MeshError: they are in degrees."""
    if system:
        if system.is_geographic:
            expected = "cells in a unit of length: gdalwarp -t_srs EPSG:326NN, for UTM, makes such"
            raise MeshError(source, "reference system", expected, f"degrees, {system.to_string()}")
        factor: float = system.linear_units_factor[1]
        return factor
    if abs(raster.transform.determinant) < _DEGREES**2 and max(map(abs, raster.bounds)) <= _AROUND:
        makes = "gdalwarp -s_srs EPSG:4326 -t_srs EPSG:326NN, for UTM, makes such"
        expected = f"cells in a unit of length: {makes}, gdal_translate -a_srs EPSG:326NN says that they are"
        raise MeshError(source, "reference system", expected, f"none, and cells of {raster.transform.a:g}, as degrees")
    return 1.0


class Cells(NamedTuple):
    """The heights of a raster.

    Attributes: heights: (h, w) in metres. has_data: (h, w), where there is one. notes: warnings.
    """

    heights: Float64s
    has_data: Bools
    notes: tuple[str, ...]


def cells_of(raster: DatasetReader) -> Cells:
    """The heights of the first band, by its scale, offset and unit. Raises: as `_read`."""
    stored = _read(raster, 1)
    has_data: Bools = (raster.read_masks(1) > 0) & np.isfinite(stored)
    notes = []
    void = has_data & ((stored == _VOID) | (np.abs(stored) > _HUGE))
    custom = has_data & (stored == _CUSTOM)
    if not (has_data & ~void & ~custom & (stored < _DEEP)).any():
        void |= custom
    if void.any():
        notes.append(f"{np.count_nonzero(void):,} cells of {stored[void][0]:g}, which no tag names, are taken for gaps")
    name = raster.units[0] or ""
    unit = _UNITS.get(name.lower(), 1.0)
    if unit != 1:
        notes.append(f"heights are in {name} and taken to metres")
    elif name.lower() not in _METRES:
        notes.append(f"heights are in {name}, which is taken for metres")
    return Cells(unit * (stored * raster.scales[0] + raster.offsets[0]), has_data & ~void, tuple(notes))


def _read(raster: DatasetReader, band: int) -> Float64s:
    """What a band stores (h, w). Raises: OSError: cells are missing or broken."""
    from rasterio.errors import RasterioIOError

    try:
        return np.asarray(raster.read(band), np.float64)
    except RasterioIOError as reason:
        raise OSError(_IN_MEMORY.sub("", str(reason.__cause__ or reason))) from None


def opened(file: Any, source: str) -> DatasetReader:
    """A raster in a file of the format that its name's ending says, by which GDAL opens no other file.

    Raises:
        MeshError: it is none, or has more cells than its bytes can hold. MemoryLimitError: its cells do not fit.
        ModuleNotFoundError: there is no rasterio.
    """
    import rasterio
    from rasterio.errors import RasterioError

    try:
        raster = rasterio.open(file, driver=_DRIVERS[Path(source).suffix.lower()])
    except RasterioError as reason:
        got = "another format" if "not recognized" in str(reason) else _IN_MEMORY.sub("", str(reason))
        raise MeshError(source, "content", f"a raster of heights, {format_of(source).name}", got) from None
    stored = file.seek(0, os.SEEK_END)
    cells, block = raster.width * raster.height, raster.count * int(np.prod(raster.block_shapes[0]))
    if max(cells, block) > max(_PACKED * stored, _FEW):
        got = f"{raster.width:,}×{raster.height:,}"
        if block > cells:
            got += " in tiles of {:,}×{:,}".format(*raster.block_shapes[0][::-1])
        raise MeshError(source, "cells", f"as many as {stored:,} bytes can hold", got)
    check_memory(source, _CELL * cells + 16 * block, f"to read {cells:,} cells")
    return raster


def raster(bake: Bake, asset: Asset, channels: Channels = Channels()) -> bytes:
    """A GeoTIFF of w and, as a second band, its standard error where that is known, float32.

    Raises: OptionError: what was baked is no raster.
    """
    if not is_raster(asset.path):
        raise OptionError("output", "an image of a texture, or terrain as the input", asset.path)
    path = asset.path
    with parser_errors(path), path.open("rb") as file, opened(file, str(path)) as source:
        has_data = cells_of(source).has_data
        grid = {name: source.profile[name] for name in _KEPT} | {"crs": _system_of(source, path)}
    bands = {name: getattr(bake, column) for name, column in _BANDS.items()}
    known_bands = {name: values for name, values in bands.items() if values is not None}
    from rasterio.io import MemoryFile

    with warnings.catch_warnings(action="ignore"), MemoryFile() as memory:  # that the raster has no place
        form = {"driver": "GTiff", "dtype": "float32", "nodata": _NO_DATA, "compress": "deflate"}
        with memory.open(**grid, **form, count=len(known_bands)) as target:
            for number, (name, values) in enumerate(known_bands.items(), 1):
                cells = np.full(has_data.shape, _NO_DATA, np.float32)
                cells[has_data] = values
                target.write(cells, number)
                target.set_band_description(number, name)
            if channels.record:
                target.update_tags(**{_RECORD: channels.record})
        content: bytes = memory.read()
    return content


def stored_columns(path: Path, wanted: Container[str]) -> dict[str, Float64s]:
    """The `wanted` of `w` and `error`, of the cells with data, as far as a bake has left them in a raster.

    Raises: as `opened` and `_read`.
    """
    with path.open("rb") as file, opened(file, str(path)) as source:
        has_data = source.read_masks(1) > 0
        columns = {number: _BANDS.get(name, "") for number, name in enumerate(source.descriptions, 1)}
        return {column: _read(source, number)[has_data] for number, column in columns.items() if column in wanted}


def stored_record(path: Path) -> str:
    """The record of the bake that a raster holds, or nothing. Raises: as `opened`."""
    with path.open("rb") as file, opened(file, str(path)) as source:
        return str(source.tags().get(_RECORD, ""))


FORMATS = (
    {
        "ending": ".asc",
        "name": "Esri ASCII grid",
        "read": "obscurance.scenes.formats.raster:read_raster",
        "peak": 2.0,
        "holds": ("raster",),
        "unit": 1.0,
    },
    {
        "ending": ".tif",
        "name": "GeoTIFF",
        "read": "obscurance.scenes.formats.raster:read_raster",
        "peak": 2.0,
        "write": "obscurance.scenes.formats.raster:raster",
        "holds": ("raster", "w"),
        "unit": 1.0,
    },
    {
        "ending": ".tiff",
        "name": "GeoTIFF",
        "read": "obscurance.scenes.formats.raster:read_raster",
        "peak": 2.0,
        "write": "obscurance.scenes.formats.raster:raster",
        "holds": ("raster", "w"),
        "unit": 1.0,
    },
)
