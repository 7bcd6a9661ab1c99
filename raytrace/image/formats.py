"""Formats of picture files, the layers that they hold, and OpenImageIO, which reads and writes them."""

import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any

from ..errors import OptionError, OutputError, is_utf8, printable
from ..system.atomic import PathName, check_writable

FORMATS = {".exr": "openexr", ".png": "png", ".tif": "tiff", ".tiff": "tiff", ".jpg": "jpeg", ".jpeg": "jpeg"}
LAYERS = {
    "beauty": 4, "ambient": 3, "diffuse": 3, "specular": 3, "emission": 3,
    "obscurance": 1, "shadow": 1, "depth": 1, "normal": 3, "albedo": 3, "object_id": 1,
}  # fmt: skip
"""Channels of each layer.

beauty is RGBA, linear, colour premultiplied by coverage; its RGB is ((ambient + diffuse) + specular) + emission in
float32. The background counts as emission, also what shows of it through transparent surfaces. shadow is the part of
the light that δ lets through (1 lit); depth the distance to the camera, inf where nothing was hit; normal a world
vector; object_id the object's row plus 1, 0 for none. depth, normal and object_id are the nearest sample's of a pixel,
all others means.
"""
DATA = ("depth", "normal", "object_id")
"""Layers that are no colours."""
NAMESPACE = "obscurance:"
"""Begins the names of metadata that a file holds of ours."""
CHANNELS = {"normal": "XYZ", "depth": "Z", "object_id": ("ID",)}
BY_COUNT = {1: "Y", 2: "YA", 3: "RGB", 4: "RGBA"}
"""Names of the channels of a layer in an EXR file: of some by their own, of the others by how many there are."""
_HELD = signal.SIGINT, signal.SIGTERM


def file_format(path: PathName) -> str:
    """OpenImageIO's name of the format of `path`. Raises: OptionError: an ending that is not in `FORMATS`."""
    try:
        return FORMATS[Path(path).suffix.lower()]
    except KeyError:
        raise OptionError("output", "a name ending in " + " ".join(FORMATS), os.fspath(path)) from None


def check_image_writable(path: PathName) -> None:
    """Check before the work that an image of this name can be written. Raises: OutputError."""
    if not is_utf8(os.path.dirname(os.path.realpath(path))):
        raise OutputError(printable(f"{os.fspath(path)}: cannot write: an image's folder must have a name in UTF-8"))
    check_writable(path)


def openimageio() -> Any:
    """The module, imported with interrupts held back: one while its C++ starts aborts the process without a line.

    An interrupt that came meanwhile is raised afterwards.
    """
    if "OpenImageIO" in sys.modules or threading.current_thread() is not threading.main_thread():
        import OpenImageIO

        return OpenImageIO
    received: list[int] = []
    handlers = {number: signal.signal(number, lambda got, _: received.append(got)) for number in _HELD}
    try:
        import OpenImageIO
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler or signal.SIG_DFL)
    for got in received:
        signal.raise_signal(got)
    return OpenImageIO
