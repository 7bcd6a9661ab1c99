"""Lights of a glTF file (KHR_lights_punctual).

Intensities are taken as they are: candela as watts per steradian, lux as watts per square metre, times the colour. A
spot's edge differs: glTF's falls off as ((cosφ − cos outer)/(cos inner − cos outer))² from the inner to the outer
angle, ours as cos^e φ up to the outer. e is the exponent for which both cones send out the same power; inner = outer
gives e = 0.
"""

from __future__ import annotations

from math import cos, degrees, pi
from typing import Any

from raytrace.lights.lights import light_from_dict
from raytrace.lights.sources import BaseLight
from raytrace.types import Float64s

from ..field_errors import located

FLOAT32_RIGHT_ANGLE = 1.5707964
EXTENSION = "KHR_lights_punctual"


def lights(header: dict[str, Any], world: dict[int, Float64s], source: object) -> tuple[BaseLight, ...]:
    """The lights of the nodes in `world` (`scenes.formats.gltf.nodes.node_matrices`), in their order.

    Raises:
        SceneError: a light with values out of range.
        Exception: a malformed header.
    """
    made = []
    for node, matrix in world.items():
        number = header["nodes"][node].get("extensions", {}).get(EXTENSION, {}).get("light")
        if number is not None:
            with located(source, f"extensions.{EXTENSION}.lights[{number}]"):
                made.append(_light(header["extensions"][EXTENSION]["lights"][number], matrix))
    return tuple(made)


def _light(stored: dict[str, Any], matrix: Float64s) -> BaseLight:
    intensity = [stored.get("intensity", 1.0) * channel for channel in stored.get("color", [1, 1, 1])]
    values: dict[str, Any] = {"light": stored["type"], "intensity": intensity}
    if stored["type"] != "directional":
        values |= {"position": matrix[:3, 3], "range": stored.get("range")}
    if stored["type"] != "point":
        values["direction"] = -matrix[:3, 2]
    if stored["type"] == "spot":
        cone = stored.get("spot", {})
        outer = cone.get("outerConeAngle", pi / 4)
        values["half_angle"] = 90.0 if pi / 2 < outer <= FLOAT32_RIGHT_ANGLE else degrees(outer)
        values["exponent"] = spot_exponent(cone.get("innerConeAngle", 0.0), outer)
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
