"""w of the cells of a height raster, as a raster of the same grid."""

import warnings

import numpy as np

from obscurance.ao import Bake
from obscurance.raytrace.errors import OptionError

from ..load import MeshFile, parser_errors
from ..table import is_raster
from .read import cells_of, opened

_NO_DATA = -9999.0
_KEPT = "width", "height", "crs", "transform"


def raster(bake: Bake, mesh_file: MeshFile, _: object) -> bytes:
    """A GeoTIFF of w and, as a second band, its standard error where that is known, float32.

    Raises: OptionError: what was baked is no raster.
    """
    if not is_raster(mesh_file.path):
        raise OptionError("output", "an image of a texture, or terrain as the input", mesh_file.path)
    path = mesh_file.path
    with parser_errors(path), path.open("rb") as file, opened(file, str(path)) as source:
        has_data = cells_of(source).has_data
        grid = {name: source.profile[name] for name in _KEPT}
    bands = {"obscurance": bake.w, "standard error": bake.error}
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
        content: bytes = memory.read()
    return content
