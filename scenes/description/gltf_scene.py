"""Materials, camera and lights of a glTF file in a scene.

A camera's node looks along its −z with +y upwards. The vertical angle (or `ymag`) is kept whatever the picture's shape.
Intensities of lights are taken as they are: candela as watts per steradian, lux as watts per square metre, times the
colour. A spot's edge differs: glTF's falls off as ((cosφ − cos outer)/(cos inner − cos outer))² from the inner to the
outer angle, ours as cos^e φ up to the outer. e is the exponent for which both cones send out the same power; inner =
outer gives e = 0.

Materials are the nearest of the reflection models here. glTF mixes a coated diffuse surface, F0 = .04, with a metal of
F0 = base colour, over GGX facets of α = roughness². The nearest here is Cook–Torrance's of RMS slope m = α, whose
weights are k_d = 1 − k_s of the base and k_s of the facets:

- k_s = .1 + .9 metallic, and η such that k_s F0 is glTF's specular reflectance at normal incidence; at grazing
  incidence it tends to k_s, where glTF's tends to 1;
- KHR_materials_pbrSpecularGlossiness: roughness = 1 − glossiness, F0 is the specular colour, the base
  the diffuse one, and metallic as far as the specular colour's largest channel lies from .04 to 1;
- metallic 0 and roughness 1: Lambert; there is no highlight to speak of;
- KHR_materials_unlit without texture: emission of the base colour, and no reflection;
- emission: emissiveFactor times KHR_materials_emissive_strength;
- KHR_materials_transmission: a share t of the light passes, alpha is multiplied by 1 − t; there is no refraction;
- doubleSided: both sides reflect what falls on them, two_sided = "viewer";
- no material, or one without the metallic-roughness table: the neutral matt grey, or matt white.

The ambient reflectance is the base colour. The base colour's texture is looked up at each hit; of metallic-roughness,
specular-glossiness and emissive textures the mean over the image multiplies the factors.
Format: Khronos glTF 2.0 specification, sections 3.9, 3.10 and appendix B; KHR_lights_punctual;
KHR_materials_pbrSpecularGlossiness, 2017.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from math import cos, degrees, pi
from typing import Any, TypeVar

import numpy as np

from obscurance.raytrace import Camera, Material, light_from_dict, material_from_dict
from obscurance.raytrace.brdf.presets import eta_from_reflectance
from obscurance.raytrace.errors import InputError
from obscurance.raytrace.image.texture import texture_mean
from obscurance.raytrace.lights.sources import BaseLight
from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.system.records import Record
from obscurance.raytrace.types import Float64s

from ..asset.asset import Asset, Stored
from ..formats.gltf import records
from ..formats.gltf.asset import Gltf, entry
from ..formats.gltf.records import parse
from ..formats.gltf.textures import Textures
from ..formats.load import parser_errors
from ..json_toml import located

_FLOAT32_RIGHT_ANGLE = 1.5707964
DIELECTRIC_F0 = 0.04
_LEAST_SLOPE = 0.02  # sharper highlights of lights without extent are smaller than a pixel
_FACETS = 0.1
_WHITE = np.ones(4)
_NO_METAL = np.array([1.0, 1.0, 0.0, 1.0])
_READ = {
    "KHR_materials_emissive_strength", "KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness",
    records.TRANSMISSION,
}  # fmt: skip
T = TypeVar("T")
Surface = tuple[list[float], float, float, Float64s]  # base colour, roughness, metallic, F0


def gltf_materials(source: Asset, numbers: Iterable[int]) -> dict[int, Material]:
    """The reflection models that are nearest to materials of a glTF, by their numbers; the asset's warnings tell what
    of them pictures do not show. Raises: SceneError, MeshError: malformed ones."""
    reader = _Reader(source.raw)
    made = {}
    for number in numbers:
        _ = source.material(number)
        with located(source.path, f"materials[{number}]"):
            made[number] = reader.model(reader.gltf.materials.materials[number])
    words = [f"of {', '.join(sorted(reader.means))} the mean"] if reader.means else []
    words += [f"left out {', '.join(sorted(reader.left_out))}"] if reader.left_out else []
    if words:
        source.warnings[f"materials: {'; '.join(words)}"] = None
    return made


class _Reader:
    """Makes models; keys of textures that are represented by their means, and of what is not used."""

    def __init__(self, raw: Stored | None) -> None:
        assert isinstance(raw, Gltf)
        self.gltf = raw
        self._textures = Textures(raw)
        self._means: dict[tuple[int | None, bool], Float64s | None] = {}
        self.means: set[str] = set()
        self.left_out: set[str] = set()

    def model(self, stored: records.GltfMaterial) -> Material:
        """The reflection model that is nearest to a glTF material; textures other than the colour's become their
        means."""
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

    def _metallic(self, stored: records.GltfMaterial) -> Surface:
        """Base colour, roughness, metalness and reflectance F₀ of metallic-roughness parameters."""
        parameters = stored.pbrMetallicRoughness
        is_metal = parameters.metallicFactor if "pbrMetallicRoughness" in vars(stored) else 0.0
        base = np.clip(parameters.baseColorFactor[:3], 0.0, 1.0).tolist()
        factors = np.clip([parameters.roughnessFactor, is_metal], 0.0, 1.0)
        mean = self._mean(parameters, "metallicRoughnessTexture", srgb=False, unread=_NO_METAL)
        roughness, metallic = (factors * mean[1:3]).tolist()
        f0 = (1 - metallic) * DIELECTRIC_F0 + metallic * np.array(base)
        return base, roughness, metallic, f0

    def _specular(self, parameters: records.SpecularGlossiness) -> Surface:
        """Base colour, roughness, metalness and F₀ of specular-glossiness parameters
        (KHR_materials_pbrSpecularGlossiness)."""
        diffuse = np.clip(parameters.diffuseFactor[:3], 0.0, 1.0)
        factors = np.clip([*parameters.specularFactor, parameters.glossinessFactor], 0.0, 1.0)
        *f0, glossiness = (factors * self._mean(parameters, "specularGlossinessTexture", srgb=True)).tolist()
        metallic = max(0.0, (max(f0) - DIELECTRIC_F0) / (1 - DIELECTRIC_F0))
        base = ((1 - metallic) * diffuse + metallic * np.array(f0)).tolist()
        return base, 1 - glossiness, metallic, np.array(f0)

    def _mean(self, record: Record, key: str, srgb: bool, unread: Float64s = _WHITE) -> Float64s:
        """The mean RGBA of a record's texture, ones without it, `unread` if it cannot be read."""
        reference: records.TextureReference | None = getattr(record, key)
        if reference is None:
            return _WHITE
        number = entry(self.gltf.materials.textures, reference.index, "textures").image
        if (number, srgb) not in self._means:
            self._means[number, srgb] = None
            if number is not None:
                with suppress(InputError):
                    self._means[number, srgb] = texture_mean(replace(self._textures.image(number), srgb=srgb))
        mean = self._means[number, srgb]
        (self.left_out if mean is None else self.means).add(key)
        return unread if mean is None else mean


def camera_and_lights(source: Asset, seen: bool) -> tuple[Camera | None, tuple[BaseLight, ...]]:
    """The first camera of a file, None without or unless it is `seen`, and its lights. Raises: MeshError, SceneError:
    malformed ones."""
    raw = source.raw
    assert isinstance(raw, Gltf)
    with parser_errors(source.path):
        stage = parse(records.Stage, raw.header, source.path)
        cameras = _placed(raw, "camera", "cameras", stage.cameras, _camera)
        lights = tuple(_placed(raw, "light", records.LIGHTS, stage.lights, _light))
        return next(cameras, None) if seen else None, lights


def _placed(
    asset: Gltf, field: str, name: str, stored: Sequence[Any], make: Callable[[Any, Float64s], T]
) -> Iterator[T]:
    """The cameras or lights of the nodes that are shown, in their order."""
    for node, matrix in asset.world.items():
        number = getattr(asset.geometry.nodes[node], field)
        if number is not None:
            with located(asset.path, f"{name}[{number}]"):
                placed = make(entry(stored, number, name), matrix)
            yield placed


def _camera(stored: records.GltfCamera, matrix: Float64s) -> Camera:
    target = matrix[:3, 3] - normalize(matrix[:3, 2])
    view: dict[str, Any] = {"position": matrix[:3, 3].tolist(), "target": target.tolist(), "up": matrix[:3, 1].tolist()}
    if stored.type == "orthographic":
        return Camera(**view, height=2.0 * stored.ymag)
    return Camera(**view, field_of_view=degrees(stored.yfov))


def _light(stored: records.GltfLight, matrix: Float64s) -> BaseLight:
    """A light of KHR_lights_punctual at the node with this map to the world (4, 4)."""
    intensity = [stored.intensity * channel for channel in stored.color]
    values: dict[str, Any] = {"light": stored.type, "intensity": intensity}
    if stored.type != "directional":
        values |= {"position": matrix[:3, 3], "range": stored.range}
    if stored.type != "point":
        values["direction"] = -matrix[:3, 2]
    if stored.type == "spot":
        outer = stored.outerConeAngle
        values["half_angle"] = 90.0 if pi / 2 < outer <= _FLOAT32_RIGHT_ANGLE else degrees(outer)
        values["exponent"] = spot_exponent(stored.innerConeAngle, outer)
    return light_from_dict(values)


def spot_exponent(inner: float, outer: float) -> float:
    """e for which ∫ cos^e φ dω over the outer cone is glTF's.

    Over 2π: (1 − cos^(e+1) outer)/(e + 1) = 1 − (2 cos inner + cos outer)/3, in radians, 0 ≤ inner ≤ outer ≤ π/2.
    """
    edge = max(cos(outer), 0.0)
    power = 1.0 - (2 * cos(min(inner, outer)) + edge) / 3.0
    if not 0.0 < power < 1.0 - edge:
        return 0.0
    from scipy.optimize import brentq  # loads for a quarter of a second

    return float(brentq(lambda e: (1.0 - edge ** (e + 1.0)) / (e + 1.0) - power, 0.0, 1.0 / power))
