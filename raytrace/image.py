"""Images on disk. The only importer of OpenImageIO."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .atomic import atomic_write
from .errors import OutputError


def encode_srgb(linear: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """sRGB values in [0, 1] of linear ones, clipped to [0, 1] (IEC 61966-2-1)."""
    x = np.clip(np.asarray(linear, np.float32), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055).astype(np.float32)


def write_image(path: str | os.PathLike[str], pixels: npt.ArrayLike) -> None:
    """Write linear `pixels` (h, w) or (h, w, channels), row 0 at the top, as an 8-bit sRGB PNG, whole or not at all.

    Raises:
        OutputError: the file cannot be written.
    """
    import OpenImageIO as oiio

    encoded = encode_srgb(pixels)
    encoded = encoded.reshape(*encoded.shape[:2], -1)
    height, width, channels = encoded.shape
    spec = oiio.ImageSpec(width, height, channels, "uint8")
    spec.attribute("oiio:ColorSpace", "sRGB")
    image = oiio.ImageBuf(spec)
    image.set_pixels(oiio.ROI(), np.ascontiguousarray(encoded))
    with atomic_write(path) as file, tempfile.TemporaryDirectory() as scratch:
        whole = Path(scratch) / "image.png"
        if not image.write(str(whole), "uint8", "png"):
            raise OutputError(f"{path}: cannot write: {image.geterror()}")
        file.write(whole.read_bytes())
