"""glTF materials as the nearest of the reflection models here.

glTF mixes a coated diffuse surface, F0 = .04, with a metal of F0 = base colour, over GGX facets of α = roughness². The
nearest here is Cook–Torrance's of RMS slope m = α, whose weights are k_d = 1 − k_s of the base and k_s of the facets:

- k_s = .1 + .9 metallic, and η such that k_s F0 is glTF's specular reflectance at normal incidence; at grazing
  incidence it tends to k_s, where glTF's tends to 1;
- KHR_materials_pbrSpecularGlossiness: roughness = 1 − glossiness, F0 is the specular colour, the base
  the diffuse one, and metallic as far as the specular colour's largest channel lies from .04 to 1;
- metallic 0 and roughness 1: Lambert; there is no highlight to speak of;
- KHR_materials_unlit without texture: emission of the base colour, and no reflection;
- emission: emissiveFactor times KHR_materials_emissive_strength;
- doubleSided: both sides reflect what falls on them, two_sided = "viewer";
- no material, or one without the metallic-roughness table: the neutral matt grey, or matt white.

The ambient reflectance is the base colour. The base colour's texture is looked up at each hit; of metallic-roughness,
specular-glossiness and emissive textures the mean over the image multiplies the factors.
Format: Khronos glTF 2.0 specification, section 3.9 and appendix B; KHR_materials_pbrSpecularGlossiness, 2017.
"""

from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from raytrace.brdf.coefficients import eta_from_reflectance
from raytrace.errors import InputError
from raytrace.image.texture import texture_mean
from raytrace.materials.base import RGB, BaseMaterial
from raytrace.materials.materials import material_from_dict
from raytrace.types import Float64s

from ..formats.gltf.asset import entry
from ..formats.gltf.parse import JsonObject
from ..formats.gltf.records import GltfMaterial, Primitive, SpecularGlossiness, TextureReference
from ..formats.gltf.textures import Textures
from .defaults import NEUTRAL, WHITE

DIELECTRIC_F0 = 0.04
_LEAST_SLOPE = 0.02  # sharper highlights of lights without extent are smaller than a pixel
_FACETS = 0.1
_WHITE, _NO_METAL = np.ones(4), np.array([1.0, 1.0, 0.0, 1.0])
_READ = {"KHR_materials_emissive_strength", "KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness"}


class _Surface(NamedTuple):
    """The factors of a material, multiplied by its textures' means."""

    base: RGB
    roughness: float
    metallic: float
    f0: Float64s


class Materials:
    """The materials of an asset, each made once.

    Attributes: means, left_out: what textures are represented by their means, and what is not used, by their keys.
    """

    def __init__(self, textures: Textures) -> None:
        self._textures, self._asset = textures, textures.asset
        self._made: dict[int, BaseMaterial] = {}
        self._means: dict[tuple[int | None, bool], Float64s | None] = {}
        self.means: set[str] = set()
        self.left_out: set[str] = set()

    @property
    def notes(self) -> tuple[str, ...]:
        """In a line what materials have that pictures do not show, if they have some."""
        words = [f"of {', '.join(sorted(self.means))} the mean"] if self.means else []
        words += [f"left out {', '.join(sorted(self.left_out))}"] if self.left_out else []
        return (f"{self._asset.path}: materials: {'; '.join(words)}",) if words else ()

    def of(self, primitive: Primitive, coloured: bool) -> BaseMaterial:
        """The material of a primitive. Args: coloured: whether its vertices have colours.

        Raises: ValueError: there is no such material, or texture.
        """
        number = primitive.material
        if number is None:
            return WHITE if coloured else NEUTRAL
        if number not in self._made:
            self._made[number] = self._material(self._asset.material(primitive))
        return self._made[number]

    def _material(self, stored: GltfMaterial) -> BaseMaterial:
        self.left_out |= {name for name in stored.extensions if name not in _READ}
        self.left_out |= {"normalTexture"} & vars(stored).keys()
        emitted = np.multiply(stored.emissiveFactor, stored.emissiveStrength)
        if emitted.any():
            emitted = emitted * self._mean(stored, "emissiveTexture", srgb=True)[:3]
        sides = "viewer" if stored.doubleSided else False
        common: dict[str, Any] = {"emission": emitted.tolist(), "two_sided": sides}
        base, roughness, metallic, f0 = self._specular(stored.specular) if stored.specular else self._metallic(stored)
        unlit = "KHR_materials_unlit" in stored.extensions
        if unlit and stored.base[1] is None:
            return material_from_dict(common | {"model": "lambert", "albedo": 0.0, "emission": base})
        if metallic == 0 and (roughness == 1 or unlit):
            return material_from_dict(common | {"model": "lambert", "albedo": base})
        facets = _FACETS + (1 - _FACETS) * metallic
        eta = [eta_from_reflectance(min(channel / facets, 0.999)) for channel in f0.tolist()]
        common |= {"albedo": base, "k_s": facets, "eta": eta, "m": max(roughness**2, _LEAST_SLOPE)}
        return material_from_dict(common | {"model": "cook_torrance"})

    def _metallic(self, stored: GltfMaterial) -> _Surface:
        given = stored.pbrMetallicRoughness
        is_metal = given.metallicFactor if "pbrMetallicRoughness" in vars(stored) else 0.0
        base = np.clip(given.baseColorFactor[:3], 0.0, 1.0).tolist()
        factors = np.clip([given.roughnessFactor, is_metal], 0.0, 1.0)
        mean = self._mean(given, "metallicRoughnessTexture", srgb=False, unread=_NO_METAL)
        roughness, metallic = (factors * mean[1:3]).tolist()
        f0 = (1 - metallic) * DIELECTRIC_F0 + metallic * np.array(base)
        return _Surface(tuple(base), roughness, metallic, f0)

    def _specular(self, given: SpecularGlossiness) -> _Surface:
        diffuse = np.clip(given.diffuseFactor[:3], 0.0, 1.0)
        factors = np.clip([*given.specularFactor, given.glossinessFactor], 0.0, 1.0)
        *f0, glossiness = (factors * self._mean(given, "specularGlossinessTexture", srgb=True)).tolist()
        metallic = max(0.0, (max(f0) - DIELECTRIC_F0) / (1 - DIELECTRIC_F0))
        base = ((1 - metallic) * diffuse + metallic * np.array(f0)).tolist()
        return _Surface(tuple(base), 1 - glossiness, metallic, np.array(f0))

    def _mean(self, record: JsonObject, key: str, srgb: bool, unread: Float64s = _WHITE) -> Float64s:
        """The mean RGBA of a record's texture, ones without it, `unread` if it cannot be read."""
        reference: TextureReference | None = getattr(record, key)
        if reference is None:
            return _WHITE
        number = entry(self._asset.materials.textures, reference.index, "textures").source
        if (number, srgb) not in self._means:
            self._means[number, srgb] = None
            if number is not None:
                with suppress(InputError):
                    self._means[number, srgb] = texture_mean(replace(self._textures.image(number), srgb=srgb))
        mean = self._means[number, srgb]
        (self.left_out if mean is None else self.means).add(key)
        return unread if mean is None else mean
