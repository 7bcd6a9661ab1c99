"""Images on disk. The only importer of OpenImageIO."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

from raytrace.errors import OutputError


def encode_srgb(linear: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """sRGB values in [0, 1] of linear ones, clipped to [0, 1] (IEC 61966-2-1)."""
    x = np.clip(np.asarray(linear, np.float32), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055).astype(np.float32)


def write_image(path: str | os.PathLike[str], pixels: npt.ArrayLike) -> None:
    """Write linear RGB `pixels` (h, w, 3), row 0 at the top, as an 8-bit sRGB PNG. Raises: OutputError."""
    import OpenImageIO as oiio

    target = Path(path)
    encoded = encode_srgb(pixels)
    height, width, channels = encoded.shape
    spec = oiio.ImageSpec(width, height, channels, "uint8")
    spec.attribute("oiio:ColorSpace", "sRGB")
    image = oiio.ImageBuf(spec)
    image.set_pixels(oiio.ROI(), np.ascontiguousarray(encoded))
    scratch = target.with_name(f".{os.getpid()}-{target.name}")
    try:
        written = image.write(str(scratch), "uint8", "png")
        if written:
            os.replace(scratch, target)
    except OSError as error:
        raise OutputError(f"{target}: cannot write: {error}") from error
    finally:
        scratch.unlink(missing_ok=True)
    if not written:
        raise OutputError(f"{target}: cannot write: {image.geterror()}")
