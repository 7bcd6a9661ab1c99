"""Pictures on disk: a frame's layers, or plain pixels, in the format that the name's ending asks for.

EXR holds all layers, linear. PNG (8 bits, dithered), TIFF (16) and JPEG (8, quality 95) hold one layer of colours or
fractions, sRGB-encoded. Every file appears whole or not at all, and the same picture gives the same bytes: no time
stamps.
"""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..errors import OptionError, OutputError, is_utf8, printable
from ..system.atomic import PathName, check_writable
from .encode import LAYERS, file_format, write_picture

DATA = ("depth", "normal", "object_id")


def check_image_target(
    path: PathName, half: bool = False, layers: Sequence[str] | None = None
) -> tuple[str, ...] | None:
    """Find out before the work whether `Frame.save` will be able to start.

    Returns the names of the layers that the file will hold, None for all there are. Raises: OptionError, OutputError.
    """
    format_name = file_format(path)
    if half and format_name != "openexr":
        raise OptionError("half", "an output that ends in .exr", os.fspath(path))
    for name in layers or ():
        if name not in LAYERS:
            raise OptionError("layers", "names out of " + ", ".join(LAYERS), name)
    if layers is not None and len(set(layers)) != max(len(layers), 1):
        raise OptionError("layers", "at least one layer, each once", ", ".join(layers) or "none")
    if format_name != "openexr":
        layers = ("beauty",) if layers is None else layers
        if len(layers) > 1 or layers[0] in DATA:
            got = ", ".join(layers)
            raise OptionError("layers", f"one layer of colours in a {Path(path).suffix} file, or an .exr file", got)
    if not is_utf8(os.path.dirname(os.path.realpath(path))):
        raise OutputError(printable(f"{os.fspath(path)}: cannot write: an image's folder must have a name in UTF-8"))
    check_writable(path)
    return None if layers is None else tuple(layers)


def write_image(path: PathName, pixels: npt.ArrayLike) -> None:
    """Write linear `pixels`, row 0 at the top, as an sRGB PNG, TIFF or JPEG. Raises: OptionError, OutputError.

    Args: pixels: (h, w) or (h, w, 1) grey, (h, w, 3) RGB, (h, w, 4) premultiplied RGBA.
    """
    check_image_target(path, layers=("beauty",))
    values = np.asarray(pixels, np.float32)
    write_picture(path, values.reshape(*values.shape[:2], -1), {})
