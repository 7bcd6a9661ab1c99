"""glTF materials as the nearest of the reflection models here.

glTF mixes a coated diffuse surface, F0 = .04, with a metal of F0 = base colour, over GGX facets of α = roughness². The
nearest here is Cook–Torrance's of RMS slope m = α, whose weights are k_d = 1 − k_s of the base and k_s of the facets:

- k_s = .1 + .9 metallic, and η such that k_s F0 is glTF's specular reflectance at normal incidence; at grazing
  incidence it tends to k_s, where glTF's tends to 1;
- metallic 0 and roughness 1: Lambert; there is no highlight to speak of;
- alpha mode BLEND with a base alpha below 1: Strauss, the one model with transparency;
- KHR_materials_unlit without texture: emission of the base colour, and no reflection;
- emission: emissiveFactor times KHR_materials_emissive_strength;
- doubleSided: both sides reflect what falls on them, two_sided = "viewer";
- no material, or one without the metallic-roughness table: the neutral matt grey, or matt white.

The ambient reflectance is the base colour. Of textures only the base colour's is used; a metallic-roughness texture
makes the material count as no metal, for the factors alone say nothing then.
Format: Khronos glTF 2.0 specification, section 3.9 and appendix B.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from raytrace.brdf.coefficients import eta_from_reflectance
from raytrace.materials.base import BaseMaterial
from raytrace.materials.materials import material_from_dict

from ..gltf.accessors import entry
from ..gltf.container import Gltf
from ..gltf.textures import base_texture
from .defaults import NEUTRAL

DIELECTRIC_F0 = 0.04
_LEAST_SLOPE = 0.02  # sharper highlights of lights without extent are smaller than a pixel
_FACETS = 0.1


def material_of(asset: Gltf, primitive: dict[str, Any]) -> BaseMaterial:
    """The material of a primitive. Raises: Exception: a malformed header."""
    if "material" not in primitive:
        return NEUTRAL
    stored = entry(asset, "materials", primitive["material"])
    extensions = stored.get("extensions", {})
    surface = stored.get("pbrMetallicRoughness", {"metallicFactor": 0.0})
    *base, alpha = (float(c) for c in np.clip(surface.get("baseColorFactor", [1, 1, 1, 1]), 0, 1))
    strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    glow = [strength * value for value in stored.get("emissiveFactor", [0, 0, 0])]
    common: dict[str, Any] = {"emission": glow, "two_sided": "viewer" if stored.get("doubleSided") else False}

    if "KHR_materials_unlit" in extensions and base_texture(asset, primitive) is None:
        return material_from_dict(common | {"model": "lambert", "albedo": 0.0, "emission": base})
    roughness = float(np.clip(surface.get("roughnessFactor", 1.0), 0, 1))
    metallic = float(np.clip(surface.get("metallicFactor", 1.0), 0, 1))
    if "metallicRoughnessTexture" in surface:
        metallic = 0.0
    if stored.get("alphaMode") == "BLEND" and alpha < 1:
        common |= {"smoothness": min(1 - roughness, 0.99), "metalness": metallic, "transparency": 1 - alpha}
        return material_from_dict(common | {"model": "strauss", "colour": base})
    if metallic == 0 and (roughness == 1 or "KHR_materials_unlit" in extensions):
        return material_from_dict(common | {"model": "lambert", "albedo": base})
    facets = _FACETS + (1 - _FACETS) * metallic
    f0 = [((1 - metallic) * DIELECTRIC_F0 + metallic * channel) / facets for channel in base]
    eta = [eta_from_reflectance(min(channel, 0.999)) for channel in f0]
    common |= {"albedo": base, "k_s": facets, "eta": eta, "m": max(roughness**2, _LEAST_SLOPE)}
    return material_from_dict(common | {"model": "cook_torrance"})
