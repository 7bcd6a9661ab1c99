"""Materials of paints, and what becomes of their images."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.image.encode import linear_png
from raytrace.image.texture import Texture, texture_codes

from ...geometry.detail import Paint
from ...geometry.opacity import opacity_map
from .buffer import Packed


def _material(paint: Paint) -> dict[str, Any]:
    """glTF's material of a paint, without its picture."""
    surface: dict[str, Any] = {
        "baseColorFactor": [*paint.colour, paint.opacity],
        "metallicFactor": paint.metallic,
        "roughnessFactor": paint.roughness,
    }
    made: dict[str, Any] = {"name": paint.name, "pbrMetallicRoughness": surface}
    if any(paint.emission):
        made["emissiveFactor"] = list(paint.emission)
    if paint.opacity < 1 or paint.opacity_texture:
        made["alphaMode"] = "BLEND"
    return made


def add_materials(packed: Packed, paints: Sequence[Paint]) -> None:
    """Append materials to a document, and to its buffer their pictures, each once."""
    numbers: dict[Any, int] = {}
    for paint in paints:
        material = _material(paint)
        packed.append("materials", material)
        key, first = (paint.texture, paint.opacity_texture), paint.texture or paint.opacity_texture
        if first is None:
            continue
        if key not in numbers:
            data = _base_colour(paint)
            kind = "image/png" if data.startswith(b"\x89PNG") else "image/jpeg"
            image = {"name": first.name, "mimeType": kind, "bufferView": packed.bytes_view(data)}
            numbers[key] = packed.append("textures", {"source": packed.append("images", image)})
        material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": numbers[key]}


def _base_colour(paint: Paint) -> bytes:
    """A PNG or JPEG file of a material's colour texture, its alpha the opacity map; of two sizes the larger.

    Raises: InputError: an image is missing or damaged.
    """
    alpha = None if paint.texture == paint.opacity_texture else opacity_map(paint)
    if paint.texture and alpha is None:
        return paint.texture.read_bytes()
    assert alpha is not None
    colour: npt.NDArray[Any] = np.full((1, 1, 3), 255, np.uint8)
    if paint.texture:
        colour = texture_codes(Texture(paint.texture))
        colour = np.repeat(colour[..., :1], 3, axis=2) if colour.shape[2] < 3 else colour[..., :3]
    if colour.dtype == np.uint16:
        colour = np.rint(colour / 257).astype(np.uint8)
    size = max(colour.shape[0], len(alpha)), max(colour.shape[1], alpha.shape[1])
    codes = np.rint(enlarged(alpha[..., None], *size) * 255).astype(np.uint8)
    return linear_png(np.concatenate([enlarged(colour, *size), codes], axis=2))


def enlarged(image: npt.NDArray[Any], height: int, width: int) -> npt.NDArray[Any]:
    """`image` (h, w, c) by bilinear interpolation, taken to repeat, codes rounded."""
    if image.shape[:2] == (height, width):
        return image.copy()
    from scipy.ndimage import zoom

    factors = height / image.shape[0], width / image.shape[1], 1
    made = zoom(image.astype(np.float32), factors, order=1, mode="grid-wrap", grid_mode=True)
    return made if image.dtype == np.float32 else np.rint(made).astype(image.dtype)
