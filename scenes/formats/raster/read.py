"""Height rasters by rasterio (GDAL): a vertex at the centre of every cell that has data, two triangles between four.

Cells are taken to metres, by the unit of the reference system, from the corner of the raster; heights are in metres.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.types import Bools, Float64s

from ...geometry.instances import Instance
from ..table import MeshInput, format_of

if TYPE_CHECKING:
    from rasterio.io import DatasetReader

_DRIVERS = {".asc": "AAIGrid", ".tif": "GTiff", ".tiff": "GTiff"}  # others of GDAL open what a content names
_IN_MEMORY = re.compile(r"\S*[0-9a-f-]{36}\.tif:? *")  # GDAL's name of the content
_CELL = 240  # bytes of memory a cell takes until it is a vertex and two triangles
_PACKED, _FEW = 1100, 1 << 20  # cells that a byte of file holds at most; so many that any file may have


def read_raster(mesh_input: MeshInput) -> list[Instance]:
    """The surface through the cells of the first band, z upwards.

    Raises: MeshError: no cell has data, or cells are in degrees. Others as `opened`.
    """
    with opened(mesh_input.file, mesh_input.source) as raster:
        heights = raster.read(1).astype(np.float64)
        has_data = data_mask(raster)
        transform = raster.transform
        unit = 1.0
        if raster.crs:
            if raster.crs.is_geographic:
                expected = "cells in a unit of length: gdalwarp -t_srs EPSG:326NN, for UTM, makes such"
                raise MeshError(mesh_input.source, "reference system", expected, f"degrees, {raster.crs.to_string()}")
            unit = raster.crs.linear_units_factor[1]
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
    return [Instance(mesh_input.name, vertices, faces, up="z")]


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


def data_mask(raster: DatasetReader) -> Bools:
    """The cells (h, w) of the first band with a height."""
    heights: Float64s = raster.read(1)
    has_data: Bools = (raster.read_masks(1) > 0) & np.isfinite(heights)
    return has_data
