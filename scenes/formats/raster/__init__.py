"""Height rasters, GeoTIFF and Esri ASCII grids: terrain in, w of every cell out."""

from ..table import FileFormat, register

_READ, _WRITE = "obscurance.scenes.formats.raster.read:read_raster", "obscurance.scenes.formats.raster.write:raster"

register(
    FileFormat(".asc", "Esri ASCII grid", read=_READ, peak=2.0, holds=("raster",), unit=1.0),
    FileFormat(".tif", "GeoTIFF", read=_READ, peak=2.0, write=_WRITE, holds=("raster",), unit=1.0),
    FileFormat(".tiff", "GeoTIFF", read=_READ, peak=2.0, write=_WRITE, holds=("raster",), unit=1.0),
)
