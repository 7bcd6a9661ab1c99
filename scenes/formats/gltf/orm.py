"""Occlusion, roughness and metalness in one image, in its R, G and B.

Format: Khronos glTF 2.0 specification, sections 3.9.2 (metallic-roughness) and 3.9.3 (occlusion).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import MeshError
from raytrace.image.encode import linear_png
from raytrace.image.texture import texture_codes
from raytrace.types import Float32s, UInt8s, UInt16s

from ..load import mesh_errors
from .asset import Gltf, entry
from .builder import GlbBuilder
from .materials import enlarged
from .occlusion import OWN, TRANSFORM, OcclusionTextures, texture_reference
from .records import WRAP, TextureReference, UvTransform
from .textures import Textures

_NAME = f"{OWN} orm"
_SURFACE, _OWN = "pbrMetallicRoughness", "metallicRoughnessTexture"


class OrmTextures(OcclusionTextures):
    """Gives materials w in R of a copy of their metallic-roughness image, or of a white one where they have none."""

    def __init__(
        self, builder: GlbBuilder, asset: Gltf | None, pages: Sequence[Float32s], replace: bool = False
    ) -> None:
        """Args: asset: the source of the document, if it is glTF. pages: w (h, w), which `give` takes by its number."""
        super().__init__(builder, replace)
        self._asset, self._pages = asset, pages
        self._made: dict[tuple[int | None, int], tuple[int, int]] = {}

    def _put(self, material: dict[str, Any], page: int, coordinates: int) -> None:
        surface = material.setdefault(_SURFACE, {})
        own: dict[str, Any] = surface.get(_OWN, {})
        key = own.get("index"), page
        if key not in self._made:
            self._made[key] = self._pack(own.get("index"), self._pages[page])
        occlusion, shared = self._made[key]
        super()._put(material, occlusion, coordinates)
        extensions = {name: value for name, value in own.get("extensions", {}).items() if name != TRANSFORM}
        kept = {name: value for name, value in own.items() if name not in ("index", "texCoord", "extensions")}
        kept |= {"extensions": extensions} if extensions else {}
        surface[_OWN] = texture_reference(shared, coordinates) | kept

    def _pack(self, number: int | None, w: Float32s) -> tuple[int, int]:
        """Textures for occlusion and for the rest, mostly one, in place of a metallic-roughness texture or of none."""
        if number is None or self._asset is None:
            stored, image = None, np.full((*w.shape, 3), 255, np.uint8)
        else:
            stored = self._asset.materials.textures[number]
            assert stored.source is not None  # as `check_orm` has found
            image = texture_codes(Textures(self._asset).image(stored.source))
        both = self.add(linear_png(with_occlusion(image, w)), _NAME, wrapS=WRAP, wrapT=WRAP)
        if stored and self._asset:
            added, sampler = self._builder.header["textures"], self._asset.sampler(stored)
            if not sampler.wrapS == sampler.wrapT == WRAP:  # what is baked is taken modulo 1
                return both, self._builder.append("textures", added[both] | {"sampler": stored.sampler})
            if stored.sampler is None:
                del added[both]["sampler"]
            else:
                added[both]["sampler"] = stored.sampler
        return both, both


def with_occlusion(image: npt.NDArray[Any], w: Float32s) -> UInt8s | UInt16s:
    """`image`, codes of 8 or 16 bits (h, w, 1 to 4), as RGB or RGBA with `w` (h', w') in R.

    The smaller of two sizes is interpolated, both taken to repeat. What is not interpolated keeps every bit, but for R.
    """
    most = np.iinfo(image.dtype).max
    if image.shape[2] < 3:
        image = np.concatenate([np.repeat(image[:, :, :1], 3, axis=2), image[:, :, 1:]], axis=2)
    height, width = (max(sides) for sides in zip(image.shape, w.shape, strict=False))
    made = np.ascontiguousarray(enlarged(image, height, width))
    made[:, :, 0] = np.rint(np.clip(enlarged(w[:, :, None], height, width)[:, :, 0], 0, 1) * most)
    return made


def check_orm(asset: Gltf | None, coordinates: int | None, replace: bool) -> None:
    """Find out before the bake whether `OrmTextures` can use the metallic-roughness textures of a source.

    Args: coordinates: the number of the set that is baked for, by primitives that have it; None for a new one of all.

    Raises: InputError: one goes by other coordinates, or is moved, or its image cannot be read.
    """
    if asset is None:
        return
    taking = OcclusionTextures(GlbBuilder(asset.header), replace)
    with mesh_errors(asset.path):
        drawn = [each.stored for each in asset.drawn]
        if coordinates is not None:
            drawn = [piece for piece in drawn if f"TEXCOORD_{coordinates}" in piece["attributes"]]
        found = {number for piece in drawn for number in taking.materials(piece) if number is not None}
        for material in sorted(found):
            own = entry(asset.materials.materials, material, "materials").pbrMetallicRoughness.metallicRoughnessTexture
            if own:
                _check(asset, own, f"materials[{material}].{_SURFACE}.{_OWN}", coordinates)


def _check(asset: Gltf, own: TextureReference, field: str, coordinates: int | None) -> None:
    moved = own.transform
    numbers = {own.texCoord, own.texCoord if moved.texCoord is None else moved.texCoord}
    if numbers != {coordinates}:
        named = "new coordinates" if coordinates is None else f"TEXCOORD_{coordinates}"
        got = " and ".join(f"TEXCOORD_{number}" for number in sorted(numbers))
        raise MeshError(asset.path, field, f"the coordinates of the bake, {named}, for --orm", got)
    if any(getattr(moved, name) != getattr(UvTransform, name) for name in ("offset", "rotation", "scale")):
        raise MeshError(asset.path, field, f"no {TRANSFORM}, for --orm", vars(moved))
    stored = entry(asset.materials.textures, own.index, "textures")
    if stored.source is None:
        raise MeshError(asset.path, f"textures[{own.index}]", "a PNG or JPEG image, for --orm", "none")
    asset.sampler(stored)  # if it is there
    image = texture_codes(Textures(asset).image(stored.source))
    if image.dtype not in (np.uint8, np.uint16) or image.shape[2] > 4:
        got = f"{image.shape[2]} channels of {image.dtype}"
        raise MeshError(asset.path, f"images[{stored.source}]", "up to four channels of 8 or 16 bits, for --orm", got)
