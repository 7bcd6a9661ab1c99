"""Pictures on disk: a frame's layers, or plain pixels, in the format that the name's ending asks for.

EXR holds all layers, linear. PNG (8 bits), TIFF (16) and JPEG (8, quality 95) hold one layer of colours or fractions,
sRGB-encoded. Every file appears whole or not at all, and the same picture gives the same bytes: no time stamps.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..errors import OptionError, OutputError, is_utf8, printable
from ..system.atomic import check_writable
from .encode import file_format, write_layers, write_picture
from .frame import LAYERS, Frame

DATA = ("depth", "normal", "object_id")


def check_image_target(
    path: str | os.PathLike[str], half: bool = False, layers: Sequence[str] | None = None
) -> tuple[str, ...] | None:
    """Find out before the work whether `write_frame` will be able to start.

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


def write_frame(
    path: str | os.PathLike[str],
    frame: Frame,
    metadata: Mapping[str, str],
    half: bool = False,
    layers: Sequence[str] | None = None,
) -> None:
    """Write a frame.

    An EXR file holds R, G, B, A of the beauty and `layer.channel` of every other layer: R, G, B of colours; X, Y, Z of
    normals; Z of depth; ID of object_id; Y of the rest. In the other formats the beauty has straight alpha (JPEG: none,
    over black); a background other than black, which is in the beauty already, makes it opaque.
    Only some rows are held in memory besides the frame.

    Args:
        path: the target; its ending is one of `FORMATS`.
        metadata: names and texts, such as the scene and the seed: attributes `obscurance:name` in EXR and PNG, a JSON
            object as the image description in TIFF and JPEG. `read_image` returns them.
        half: 16-bit floats in EXR (magnitudes above 65504 are clipped); depth and object_id stay 32-bit.
        layers: which to write; all of the frame's in EXR, the beauty in other formats.

    Raises: OptionError: an ending or a layer that cannot be written, or that the frame lacks. OutputError.
    """
    chosen = check_image_target(path, half, layers)
    for name in chosen or ():
        if name not in frame.layers:
            raise OptionError("layers", "layers of the frame: " + ", ".join(frame.layers), name)
    if file_format(path) == "openexr":
        names = [name for name in LAYERS if name in frame.layers] if chosen is None else list(chosen)
        write_layers(path, {name: frame.layers[name] for name in names}, metadata, half)
    else:
        assert chosen is not None
        write_picture(path, frame.layers[chosen[0]], metadata, opaque=any(frame.background))


def write_image(path: str | os.PathLike[str], pixels: npt.ArrayLike) -> None:
    """Write linear `pixels`, row 0 at the top, as an sRGB PNG, TIFF or JPEG. Raises: OptionError, OutputError.

    Args: pixels: (h, w) or (h, w, 1) grey, (h, w, 3) RGB, (h, w, 4) premultiplied RGBA.
    """
    check_image_target(path, layers=("beauty",))
    whole = np.asarray(pixels, np.float32)
    write_picture(path, whole.reshape(*whole.shape[:2], -1), {})
