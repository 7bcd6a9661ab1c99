"""Occlusion textures put into a glTF document, and the texture coordinates that they use.

A material's occlusion texture multiplies indirect light alone by its R, linear, 1 = open, and goes by one set of
texture coordinates: one of primitives with different sets becomes several (Khronos glTF 2.0, sections 3.7.2 and 3.9.3).
"""

import copy
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np

from obscurance.raytrace.image.write import linear_png
from obscurance.raytrace.types import AnyFloats, Float32s

from .builder import GlbBuilder
from .records import WRAP

OWN = "obscurance"  # names of images of ours begin so: a later bake replaces their textures
RAMP = f"{OWN} ramp"
LINEAR, CLAMP_TO_EDGE = 9729, 33071
_VARIANTS, TRANSFORM = "KHR_materials_variants", "KHR_texture_transform"


@dataclass(eq=False)
class OcclusionTextures:
    """Occlusion textures for primitives of a document: `add` images, `give` them to primitives, then `apply` once.

    Args: replace: put them also in place of occlusion textures that are not ours.
    """

    builder: GlbBuilder
    replace: bool = False
    apart: set[int] = field(default_factory=set)  # numbers of the textures that could not hold w as asked for
    _given: dict[int, tuple[int, int]] = field(default_factory=dict)  # texture and coordinates by the id of a primitive

    def add(self, png: bytes, name: str, **sampler: int) -> int:
        """Index of a new texture, of a file by `raytrace.image.write.linear_png`.

        Args: name: of its image; begins with `OWN`. sampler: filters and wrap modes in place of linear and clamped.
        """
        image = {"name": name, "mimeType": "image/png", "bufferView": self.builder.bytes_view(png)}
        modes = {"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE} | sampler
        append = self.builder.append
        return append("textures", {"sampler": append("samplers", modes), "source": append("images", image)})

    def add_page(self, w: Float32s) -> int:
        """Index of a new texture of w (h, w), in 8 bits, which repeats."""
        codes = np.rint(np.clip(w, 0, 1) * 255).astype(np.uint8)
        return self.add(linear_png(codes[:, :, None]), f"{OWN} occlusion", wrapS=WRAP, wrapT=WRAP)

    def materials(self, primitive: dict[str, Any]) -> list[int | None]:
        """The primitive's materials that have no occlusion texture that is to be kept; None for no material."""
        return list(filter(self._is_replaceable, _materials(primitive)))

    def give(self, primitive: dict[str, Any], texture: int, coordinates: int) -> None:
        """Record that a primitive is to have this texture, by its TEXCOORD set `coordinates`."""
        self._given[id(primitive)] = texture, coordinates

    def apply(self) -> None:
        """Put the textures into the primitives' materials, the default one for none; materials that other primitives
        share are copied first, and keep their places."""
        header = self.builder.header
        before = copy.deepcopy(header.get("materials", []))
        others: set[int | None] = {None}  # there is no such entry
        uses: dict[tuple[int | None, int, int], list[dict[str, Any]]] = {}
        for primitive in (piece for mesh in header["meshes"] for piece in mesh["primitives"]):
            given = self._given.get(id(primitive))
            for slot in _slots(primitive):
                material = slot.get("material")
                if given is None:
                    others.add(material)
                elif self._is_replaceable(material):
                    uses.setdefault((material, *given), []).append(slot)
        for (material, texture, coordinates), slots in uses.items():
            if material in others:
                copied = {} if material is None else copy.deepcopy(before[material])
                number = self.builder.append("materials", copied)
                for slot in slots:
                    slot["material"] = number
            else:
                copied = header["materials"][material]
                others.add(material)
            self._assign(copied, texture, coordinates)

    def _assign(self, material: dict[str, Any], texture: int, coordinates: int) -> None:
        """Let a material look up this texture by the TEXCOORD set `coordinates`."""
        material["occlusionTexture"] = texture_reference(texture, coordinates)

    def _is_replaceable(self, material: int | None) -> bool:
        """Whether a material may get an occlusion texture: it has none, or one that may be replaced."""
        header = self.builder.header
        if material is not None and material >= len(header.get("materials", [])):
            return False
        reference = occlusion_reference(header, material)
        return self.replace or reference is None or image_name(header, reference).startswith(OWN)


def kept_in_words(primitives: str) -> str:
    """A warning that occlusion textures of the source stay. Args: primitives: how many have these, in words."""
    advice = "so viewers do not show the bake there; --replace-occlusion replaces them"
    return f"keeps the file's own occlusion textures (primitives: {primitives}), {advice}"


def texture_reference(texture: int, coordinates: int) -> dict[str, Any]:
    """A material's reference to a texture by a TEXCOORD set."""
    return {"index": texture, **({"texCoord": coordinates} if coordinates else {})}


def free_set(header: dict[str, Any], primitive: dict[str, Any]) -> int:
    """Number of the first TEXCOORD set that a primitive has not, or for our ramp alone, nor its materials refer to."""
    names = {*primitive["attributes"], *(name for target in primitive.get("targets", []) for name in target)}
    used: set[int] = set()
    for material in _materials(primitive):
        ramp = occlusion_reference(header, material) if is_ramp(header, material) else None
        references = _references(stored_entry(header, "materials", material))
        used |= {number for reference in references if reference is not ramp for number in sets_of(reference)}
    ramps = ramp_sets(header, primitive)
    return next(n for n in count() if n not in used and (n in ramps or f"TEXCOORD_{n}" not in names))


def is_ramp(header: dict[str, Any], material: int | None) -> bool:
    """Whether a material's occlusion texture is a ramp of ours."""
    reference = occlusion_reference(header, material)
    return reference is not None and image_name(header, reference) == RAMP


def ramp_sets(header: dict[str, Any], primitive: dict[str, Any]) -> set[int]:
    """Numbers of the TEXCOORD sets by which a primitive's materials use a ramp of ours."""
    ramps = [number for number in _materials(primitive) if is_ramp(header, number)]
    return {occlusion_reference(header, number).get("texCoord", 0) for number in ramps}


def add_coordinates(builder: GlbBuilder, primitive: dict[str, Any], number: int, uv: AnyFloats) -> None:
    """Give a primitive the set TEXCOORD_`number`, uv (n, 2), v downwards; sets below it that it lacks become zeros.

    The specification wants them contiguous, and viewers read zeros there.
    """
    for lower in range(number):
        if f"TEXCOORD_{lower}" not in primitive["attributes"]:
            primitive["attributes"][f"TEXCOORD_{lower}"] = builder.accessor(np.zeros((len(uv), 2), "<f4"))
    primitive["attributes"][f"TEXCOORD_{number}"] = builder.accessor(uv.astype("<f4"))


def occlusion_reference(header: dict[str, Any], material: int | None) -> Any:
    """The reference (`index`, `texCoord`, `strength`) to a material's occlusion texture, or None."""
    return stored_entry(header, "materials", material).get("occlusionTexture")


def stored_entry(header: dict[str, Any], key: str, number: int | None) -> dict[str, Any]:
    """The entry of this number of a list of a header, or an empty one if there is none."""
    entries: list[dict[str, Any]] = header.get(key, [])
    return entries[number] if number is not None and 0 <= number < len(entries) else {}


def _source(header: dict[str, Any], reference: dict[str, Any]) -> int | None:
    """The number of the image that a texture reference leads to."""
    texture = stored_entry(header, "textures", reference["index"])
    webp: int | None = texture.get("extensions", {}).get("EXT_texture_webp", {}).get("source")
    return webp if texture.get("source") is None else texture["source"]


def image_name(header: dict[str, Any], reference: dict[str, Any]) -> str:
    """Name of the image that a texture reference leads to; empty if it has none, or leads nowhere."""
    return str(stored_entry(header, "images", _source(header, reference)).get("name", ""))


def texture_images(header: dict[str, Any], material: dict[str, Any]) -> tuple[tuple[int, int], ...]:
    """Each TEXCOORD set of a material and the number of an image that it uses by it, ascending, without images of
    earlier bakes."""
    used = [one for one in _references(material) if not image_name(header, one).startswith(OWN)]
    sources = ((number, _source(header, one)) for one in used for number in sets_of(one))
    return tuple(sorted({(number, source) for number, source in sources if source is not None}))


def _slots(primitive: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The tables with a `material` of the primitive: itself, and the mappings of its variants."""
    yield primitive
    yield from primitive.get("extensions", {}).get(_VARIANTS, {}).get("mappings", [])


def _materials(primitive: dict[str, Any]) -> list[int | None]:
    """The materials of a primitive and of its variants, None for the default one."""
    return [slot.get("material") for slot in _slots(primitive)]


def _references(stored: Any) -> Iterator[dict[str, Any]]:
    """All texture references in a material, extensions' included."""
    if isinstance(stored, dict):
        if isinstance(stored.get("index"), int):
            yield stored
        for inner in stored.values():
            yield from _references(inner)


def sets_of(reference: dict[str, Any]) -> set[int]:
    """The sets of texture coordinates that readers with and without KHR_texture_transform take."""
    untransformed = reference.get("texCoord", 0)
    numbers = untransformed, reference.get("extensions", {}).get(TRANSFORM, {}).get("texCoord", untransformed)
    return {number for number in numbers if isinstance(number, int)}
