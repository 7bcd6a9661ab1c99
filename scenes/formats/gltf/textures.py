"""Materials and textures of a glTF file.

Of samplers the wrap modes are read; filtering is the renderer's. Format: Khronos glTF 2.0 specification, sections
3.6.2, 3.8, 3.9.2 to 3.9.4 and 5.26; KHR_texture_transform, EXT_texture_webp; KHR_materials_transmission.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal
from urllib.parse import unquote

import numpy as np

from obscurance.raytrace.errors import InputError, MeshError, SceneError
from obscurance.raytrace.image.texture import Texture, Wrap, texture_mean

from ...asset.asset import Asset
from ...asset.material import Lookup, Material
from ...json_toml import shown
from ...safe_paths import confined, resolve_uri
from .accessors import view_bytes
from .asset import Gltf, entry
from .occlusion import is_ramp, texture_images
from .records import TRANSMISSION, GltfMaterial, GltfTexture, TextureReference

_MODES: dict[int, Wrap] = {10497: "repeat", 33648: "mirrored_repeat", 33071: "clamp_to_edge"}
_ALPHA: dict[str, Literal["opaque", "mask", "blend"]] = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}


@dataclass(eq=False)
class Textures:
    """The textures of a file, each made once; `notes` gets those of pictures that cannot be had."""

    asset: Gltf
    notes: dict[str, None] = field(default_factory=dict)
    _made: dict[tuple[int, tuple[Wrap, Wrap], bool], Texture] = field(default_factory=dict)

    def materials(self) -> Iterator[Material]:
        """The materials. Raises: MeshError: they are malformed."""
        tables = self.asset.header.get("materials", [])
        for number, stored in enumerate(self.asset.materials.materials):
            colour, reference = stored.base
            texture = self._lookup(reference, srgb=True)
            occlusion = self._lookup(stored.occlusionTexture, srgb=False)
            if occlusion and stored.occlusionTexture:
                strength = float(np.clip(stored.occlusionTexture.strength, 0.0, 1.0))
                occlusion = occlusion._replace(strength=strength, is_ramp=is_ramp(self.asset.header, number))
            red, green, blue, opacity = np.clip(colour, 0.0, 1.0).tolist()
            transmitted = self._transmission(stored)
            if transmitted and stored.alphaMode == "MASK":
                self.notes[f"materials[{number}]: {TRANSMISSION} of what is cut out is not read"] = None
                transmitted = 0.0
            yield Material(
                str(stored.name or f"material {number}"),
                (red, green, blue),
                (1.0 if stored.alphaMode == "OPAQUE" else opacity) * (1.0 - transmitted),
                _ALPHA[stored.alphaMode],
                stored.alphaCutoff,
                texture=texture,
                opacity_texture=texture,
                occlusion=occlusion,
                images=texture_images(self.asset.header, tables[number]),
            )

    def _transmission(self, material: GltfMaterial) -> float:
        """The share t in [0, 1] of light that passes a material: its factor, times the mean of its texture."""
        share = float(np.clip(material.transmission.transmissionFactor, 0.0, 1.0))
        reference = material.transmission.transmissionTexture
        if share and reference:
            stored = entry(self.asset.materials.textures, reference.index, "textures")
            if stored.image is not None:
                try:
                    share *= float(texture_mean(replace(self.image(stored.image), srgb=False))[0])
                except InputError as fault:
                    self.notes[f"{self._without_path(fault)}; the picture is left out"] = None
        return share

    def _lookup(self, reference: TextureReference | None, srgb: bool) -> Lookup | None:
        """The lookup of a reference, which only who uses it finds to be malformed."""
        if reference is None:
            return None
        moved = reference.transform
        number = reference.texCoord if moved.texCoord is None else moved.texCoord
        shift = (moved.scale, moved.rotation, moved.offset) if vars(moved) else None
        try:
            texture, fault = self._texture(reference.index, srgb)
        except ValueError as error:
            return Lookup(None, number, error=error)
        return Lookup(texture, number, shift, fault=fault)

    def _texture(self, number: int, srgb: bool) -> tuple[Texture | None, str]:
        """A texture of the file, and why it is left out as a colour.

        A picture in a format that is not read is there for who needs it, and refuses it by name.

        Raises: ValueError: it is not there, or malformed.
        """
        stored = entry(self.asset.materials.textures, number, "textures")
        image = stored.unreadable if stored.image is None else stored.image
        fault = ""
        if stored.image is None:
            got = ", ".join(stored.extensions) or "none"
            fault = f"textures[{number}]: expected a PNG, JPEG or WebP picture, got {got}"
        if image is None:
            return None, fault
        key = image, self._wrap(stored), srgb
        if key not in self._made:
            try:
                self._made[key] = replace(self.image(image), wrap=key[1], srgb=srgb)
            except SceneError as reason:
                return None, fault or self._without_path(reason)
        return self._made[key], fault

    def _without_path(self, fault: InputError) -> str:
        return str(fault).removeprefix(f"{self.asset.path}: ")

    def _wrap(self, texture: GltfTexture) -> tuple[Wrap, Wrap]:
        """Wrap modes along u and v of a texture. Raises: MeshError: modes of no name."""
        sampler = self.asset.sampler(texture)
        for name in ("wrapS", "wrapT"):
            got = getattr(sampler, name)
            if not isinstance(got, int) or got not in _MODES:
                field = f"samplers[{texture.sampler}].{name}"
                raise MeshError(self.asset.path, field, "10497, 33648 or 33071", shown(got))
        return _MODES[sampler.wrapS], _MODES[sampler.wrapT]

    def image(self, number: int) -> Texture:
        """An image of the asset, as a texture that repeats. Raises: SceneError: it is missing, or elsewhere."""
        stored = entry(self.asset.geometry.images, number, "images")
        label = self.asset.path.with_name(f"{self.asset.path.name}: images[{number}]")
        if stored.bufferView is not None:
            return Texture(label, data=bytes(view_bytes(self.asset, stored.bufferView)))
        field = f"images[{number}].uri"
        if stored.uri.startswith("data:"):
            data = self.asset.referenced(stored.uri)
            if not data:
                raise SceneError(self.asset.path, field, "an image in base64", shown(stored.uri))
            return Texture(label, data)
        folder = self.asset.path.parent
        return Texture(resolve_uri(stored.uri, folder) or confined(unquote(stored.uri), folder, self.asset.path, field))


def image_names(source: Asset) -> list[str]:
    """What a glTF calls its images, or what they are where it gives them no names."""
    raw = source.raw
    assert isinstance(raw, Gltf)
    images = zip(raw.header.get("images", []), raw.geometry.images, strict=True)
    return [
        str(table.get("name") or ("" if image.uri.startswith("data:") else image.uri) or table.get("mimeType"))
        for table, image in images
    ]
