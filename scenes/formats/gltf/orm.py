"""Occlusion, roughness and metalness in one image, in its R, G and B.

Format: Khronos glTF 2.0 specification, sections 3.9.2 (metallic-roughness) and 3.9.3 (occlusion).
"""

from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.image.texture import texture_codes
from obscurance.raytrace.image.write import linear_png
from obscurance.raytrace.types import Float32s, UInt8s, UInt16s

from .asset import Gltf, entry
from .occlusion import OWN, TRANSFORM, OcclusionTextures, sets_of, texture_reference
from .plain import enlarged
from .records import WRAP
from .textures import Textures

_NAME = f"{OWN} orm"
_SURFACE, _REFERENCE = "pbrMetallicRoughness", "metallicRoughnessTexture"
_IDENTITY = {"offset": [0, 0], "rotation": 0, "scale": [1, 1]}  # of `TRANSFORM`


@dataclass(eq=False)
class OrmTextures(OcclusionTextures):
    """Gives materials w in R of a copy of their metallic-roughness image, or of a white one where they have none.

    An image that cannot hold w, by the coordinates that are baked for, stays, and w gets one of its own.

    Args: asset: the source of the document, if it is glTF.
    """

    asset: Gltf | None = None
    _pages: list[Float32s] = field(default_factory=list)
    _images: dict[int, npt.NDArray[Any] | None] = field(default_factory=dict)
    _packed: dict[tuple[int | None, int], tuple[int, int]] = field(default_factory=dict)
    _separate: dict[int, int] = field(default_factory=dict)

    def add_page(self, w: Float32s) -> int:
        """The number of w (h, w), for `give`."""
        self._pages.append(w)
        return len(self._pages) - 1

    def _assign(self, material: dict[str, Any], page: int, coordinates: int) -> None:
        """Put w into R of the material's metallic-roughness image, or beside it where that cannot be."""
        surface = material.setdefault(_SURFACE, {})
        reference: dict[str, Any] = surface.get(_REFERENCE, {})
        number: int | None = reference.get("index")
        if number is not None and (not _goes_by(reference, coordinates) or self._image(number) is None):
            self.apart.add(number)
            if page not in self._separate:
                self._separate[page] = super().add_page(self._pages[page])
            super()._assign(material, self._separate[page], coordinates)
            return
        if (number, page) not in self._packed:
            self._packed[number, page] = self._pack(number, self._pages[page])
        occlusion, shared = self._packed[number, page]
        super()._assign(material, occlusion, coordinates)
        extensions = {name: value for name, value in reference.get("extensions", {}).items() if name != TRANSFORM}
        further = {name: value for name, value in reference.items() if name not in ("index", "texCoord", "extensions")}
        further |= {"extensions": extensions} if extensions else {}
        surface[_REFERENCE] = texture_reference(shared, coordinates) | further

    def _image(self, number: int) -> npt.NDArray[Any] | None:
        """The codes (h, w, 1 to 4) of a texture; None if it cannot be read, or has not 8 or 16 bits."""
        if number not in self._images and self.asset:
            self._images[number] = None
            with suppress(ValueError):  # an image or sampler that is not there, or no PNG or JPEG
                texture = entry(self.asset.materials.textures, number, "textures")
                self.asset.sampler(texture)
                if texture.image is not None:
                    codes = texture_codes(Textures(self.asset).image(texture.image))
                    if codes.dtype in (np.uint8, np.uint16) and codes.shape[2] <= 4:
                        self._images[number] = codes
        return self._images.get(number)

    def _pack(self, number: int | None, w: Float32s) -> tuple[int, int]:
        """Textures for occlusion and for the rest, mostly one, in place of a metallic-roughness texture or of none."""
        image = None if number is None else self._image(number)
        if image is None:
            image = np.full((*w.shape, 3), 255, np.uint8)
        combined = self.add(linear_png(with_occlusion(image, w)), _NAME, wrapS=WRAP, wrapT=WRAP)
        if number is not None and self.asset:
            added = self.builder.header["textures"]
            stored = self.asset.materials.textures[number]
            sampler = self.asset.sampler(stored)
            if not sampler.wrapS == sampler.wrapT == WRAP:  # what is baked is taken modulo 1
                return combined, self.builder.append("textures", added[combined] | {"sampler": stored.sampler})
            if stored.sampler is None:
                del added[combined]["sampler"]
            else:
                added[combined]["sampler"] = stored.sampler
        return combined, combined


def _goes_by(reference: dict[str, Any], coordinates: int) -> bool:
    """Whether a texture is looked up at the coordinates of this set alone, and where they say."""
    transform = reference.get("extensions", {}).get(TRANSFORM, {})
    stays = all(transform.get(name, value) == value for name, value in _IDENTITY.items())
    return stays and sets_of(reference) == {coordinates}


def with_occlusion(image: npt.NDArray[Any], w: Float32s) -> UInt8s | UInt16s:
    """`image`, codes of 8 or 16 bits (h, w, 1 to 4), as RGB or RGBA with `w` (h', w') in R.

    The smaller of two sizes is interpolated, both taken to repeat. What is not interpolated keeps every bit, but for R.
    """
    most = np.iinfo(image.dtype).max
    if image.shape[2] < 3:
        image = np.concatenate([np.repeat(image[:, :, :1], 3, axis=2), image[:, :, 1:]], axis=2)
    height = max(image.shape[0], w.shape[0])
    width = max(image.shape[1], w.shape[1])
    combined = np.ascontiguousarray(enlarged(image, height, width))
    combined[:, :, 0] = np.rint(np.clip(enlarged(w[:, :, None], height, width)[:, :, 0], 0, 1) * most)
    return combined
