"""Opacity maps of materials.

Wavefront MTL 5.0 has luminance for scalar textures such as `map_d`; exporters also name there the picture of the
colour, whose alpha they mean.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from raytrace.errors import InputError
from raytrace.image.texture import Texture, texture_codes
from raytrace.types import Float32s

from .detail import Paint

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def is_opacity_map(path: Path, colour: Path | None) -> bool:
    """Whether an image, read wholly, can be an opacity map beside that of the `colour`, if there is one.

    One that is both needs an alpha channel.
    """
    try:
        channels = [texture_codes(Texture(each)).shape[2] for each in {path, colour} if each]
    except InputError:
        return False
    return path != colour or channels[0] in (2, 4)


def opacity_map(paint: Paint) -> Float32s | None:
    """Opacity (h, w) in [0, 1], rows from the top, of a material's `opacity_texture`; None if it has none.

    The alpha channel if the image is also that of the colour, or if it is not constant; else luminance as stored.

    Raises: InputError: the file is missing, damaged, not an image, or too large.
    """
    if paint.opacity_texture is None:
        return None
    codes = texture_codes(Texture(paint.opacity_texture))
    most = 1.0 if codes.dtype == np.float32 else 2.0 ** (8 * codes.itemsize) - 1
    has_alpha = codes.shape[2] in (2, 4)
    if has_alpha and (paint.opacity_texture == paint.texture or (codes[..., -1] != codes[0, 0, -1]).any()):
        shown = codes[..., -1].astype(np.float32)
    else:
        shown = codes[..., :3] @ _LUMINANCE if codes.shape[2] > 2 else codes[..., 0].astype(np.float32)
    return np.clip(np.nan_to_num(shown / np.float32(most)), 0, 1).astype(np.float32)
