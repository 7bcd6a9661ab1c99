"""Lights of a glTF file (KHR_lights_punctual).

Intensities are taken as they are: candela as watts per steradian, lux as watts per square metre, times the colour. A
spot's edge differs: glTF's falls off as ((cosφ − cos outer)/(cos inner − cos outer))² from the inner to the outer
angle, ours as cos^e φ up to the outer. e is the exponent for which both cones send out the same power; inner = outer
gives e = 0.
"""

from math import cos, degrees, pi
from typing import Any

from raytrace.lights.sources import BaseLight, light_from_dict
from raytrace.types import Float64s

from ..field_errors import located
from ..formats.gltf.asset import Gltf, entry
from ..formats.gltf.records import LIGHTS, GltfLight

FLOAT32_RIGHT_ANGLE = 1.5707964


def lights(asset: Gltf) -> tuple[BaseLight, ...]:
    """The lights of the nodes that are shown, in their order.

    Raises:
        MeshError: malformed lights.
        SceneError: a light with values out of range.
        ValueError: there is no such light.
    """
    placed, stored = [], asset.stage.lights
    for node, matrix in asset.world.items():
        number = asset.geometry.nodes[node].light
        if number is not None:
            with located(asset.path, f"{LIGHTS}[{number}]"):
                placed.append(_light(entry(stored, number, LIGHTS), matrix))
    return tuple(placed)


def _light(stored: GltfLight, matrix: Float64s) -> BaseLight:
    intensity = [stored.intensity * channel for channel in stored.color]
    values: dict[str, Any] = {"light": stored.type, "intensity": intensity}
    if stored.type != "directional":
        values |= {"position": matrix[:3, 3], "range": stored.range}
    if stored.type != "point":
        values["direction"] = -matrix[:3, 2]
    if stored.type == "spot":
        outer = stored.outerConeAngle
        values["half_angle"] = 90.0 if pi / 2 < outer <= FLOAT32_RIGHT_ANGLE else degrees(outer)
        values["exponent"] = spot_exponent(stored.innerConeAngle, outer)
    return light_from_dict(values)


def spot_exponent(inner: float, outer: float) -> float:
    """e for which ∫ cos^e φ dω over the outer cone is glTF's.

    Over 2π: (1 − cos^(e+1) outer)/(e + 1) = 1 − (2 cos inner + cos outer)/3.

    Args: angles from the axis in radians, 0 ≤ inner ≤ outer ≤ π/2.
    """
    edge = max(cos(outer), 0.0)
    power = 1.0 - (2 * cos(min(inner, outer)) + edge) / 3.0
    if not 0.0 < power < 1.0 - edge:
        return 0.0
    from scipy.optimize import brentq  # loads for a quarter of a second

    return float(brentq(lambda e: (1.0 - edge ** (e + 1.0)) / (e + 1.0) - power, 0.0, 1.0 / power))
