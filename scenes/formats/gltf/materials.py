"""glTF materials of a mesh file that was no glTF, with their images.

Format: Khronos glTF 2.0 specification, section 3.9.2 (metallic-roughness).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.image.colour import rgb_codes
from obscurance.raytrace.image.texture import Texture, texture_alpha, texture_codes
from obscurance.raytrace.image.write import linear_png

from ...asset.material import Material
from .builder import GlbBuilder


def add_materials(builder: GlbBuilder, materials: Sequence[Material]) -> None:
    """Append materials to a document, and to its buffer their pictures, each once."""
    numbers: dict[Any, int] = {}
    for source in materials:
        surface: dict[str, Any] = {"baseColorFactor": [*source.colour, source.opacity]}
        surface |= {"metallicFactor": source.metallic, "roughnessFactor": source.roughness}
        material: dict[str, Any] = {"name": source.name, "pbrMetallicRoughness": surface}
        if any(source.emission):
            material["emissiveFactor"] = list(source.emission)
        if source.alpha == "blend":
            material["alphaMode"] = "BLEND"
        builder.append("materials", material)
        colour, alpha = (used and used.texture for used in (source.texture, source.opacity_texture))
        if not (colour or alpha):
            continue
        key = colour, alpha
        if key not in numbers:
            data = _base_colour(colour, alpha)
            kind = "image/png" if data.startswith(b"\x89PNG") else "image/jpeg"
            image = {"name": source.pictures[0].name, "mimeType": kind, "bufferView": builder.bytes_view(data)}
            numbers[key] = builder.append("textures", {"source": builder.append("images", image)})
        surface["baseColorTexture"] = {"index": numbers[key]}


def _base_colour(colour: Texture | None, opacity: Texture | None) -> bytes:
    """A PNG or JPEG file of a colour texture, its alpha the opacity map; of two sizes the larger."""
    if colour and opacity in (None, colour):
        return colour.path.read_bytes()
    # Alpha if that is not constant, for exporters name the picture of the colour; else luminance as stored, as
    # Wavefront MTL 5.0 has it for scalar textures.
    assert opacity
    alpha = texture_alpha(opacity, grey=True)
    rgb: npt.NDArray[Any] = rgb_codes(texture_codes(colour)) if colour else np.full((1, 1, 3), 255, np.uint8)
    size = max(rgb.shape[0], len(alpha)), max(rgb.shape[1], alpha.shape[1])
    codes = np.rint(enlarged(alpha[..., None], *size) * 255).astype(np.uint8)
    return linear_png(np.concatenate([enlarged(rgb, *size), codes], axis=2))


def enlarged(image: npt.NDArray[Any], height: int, width: int) -> npt.NDArray[Any]:
    """`image` (h, w, c) by bilinear interpolation, taken to repeat, codes rounded."""
    if image.shape[:2] == (height, width):
        return image.copy()
    from scipy.ndimage import zoom

    factors = height / image.shape[0], width / image.shape[1], 1
    zoomed: npt.NDArray[Any] = zoom(image.astype(np.float32), factors, order=1, mode="grid-wrap", grid_mode=True)
    return zoomed if image.dtype == np.float32 else np.rint(zoomed).astype(image.dtype)
