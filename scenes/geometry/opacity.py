"""Opacity maps of materials.

Wavefront MTL 5.0 has luminance for scalar textures such as `map_d`; exporters also name there the picture of the
colour, whose alpha they mean.
"""

from pathlib import Path

from raytrace.errors import InputError, MemoryLimitError
from raytrace.image.texture import Texture, texture_alpha, texture_codes
from raytrace.types import Float32s

from .detail import Paint


def is_opacity_map(path: Path, colour: Path | None) -> bool:
    """Whether an image, read wholly, can be an opacity map; one that is the `colour`, too, needs an alpha channel."""
    try:
        channels = [texture_codes(Texture(each)).shape[2] for each in {path, colour} if each]
    except MemoryLimitError:
        raise
    except InputError:
        return False
    return path != colour or channels[0] in (2, 4)


def opacity_map(paint: Paint) -> Float32s | None:
    """Opacity (h, w) in [0, 1], rows from the top, of a material's `opacity_texture`; None if it has none.

    The alpha channel if the image is also that of the colour, or if it is not constant; else luminance as stored.
    """
    if paint.opacity_texture is None:
        return None
    return texture_alpha(Texture(paint.opacity_texture), grey=paint.opacity_texture != paint.texture)
