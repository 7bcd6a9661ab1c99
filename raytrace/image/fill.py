"""Filling of unknown pixels from known ones."""

import numpy as np

from ..errors import ObscuranceError
from ..types import Bools, Float32s


def fill_holes(pixels: Float32s, known: Bools) -> Float32s:
    """`pixels` (h, w, c) with unknown pixels filled from `known` ones, bool (h, w), which keep every bit.

    The push–pull method (Gortler, Grzeszczuk, Szeliski & Cohen 1996) in OpenImageIO: near known pixels as they are,
    farther away their means over larger and larger surroundings.
    """
    import OpenImageIO as oiio

    if known.all() or not known.any():
        return pixels.copy()
    alpha, channels = known[:, :, None].astype(np.float32), pixels.shape[2]
    source = oiio.ImageBuf(np.concatenate([pixels * alpha, alpha], axis=2))
    source.specmod().alpha_channel = channels
    filled = oiio.ImageBufAlgo.fillholes_pushpull(source)
    pushed = None if filled.has_error else filled.get_pixels("float")
    if pushed is None:
        raise ObscuranceError(f"padding failed: {filled.geterror()}")
    return np.where(known[:, :, None], pixels, np.asarray(pushed, np.float32)[:, :, :channels])
