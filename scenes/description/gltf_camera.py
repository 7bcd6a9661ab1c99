"""The camera of a glTF file.

A node looks along its −z with +y upwards. The vertical angle (or `ymag`) is kept whatever the picture's shape.
Format: Khronos glTF 2.0 specification, section 3.10.
"""

from __future__ import annotations

from math import degrees
from typing import Any

import numpy.typing as npt

from raytrace.camera import Camera
from raytrace.mesh.normals import normalize

from ..field_errors import located

Floats = npt.NDArray[Any]


def camera(header: dict[str, Any], world: dict[int, Floats], source: object) -> Camera | None:
    """The first camera among the nodes in `world` (`scenes.formats.gltf.nodes.node_matrices`), or None.

    Raises:
        SceneError: a camera with values out of range.
        Exception: a malformed header.
    """
    for node, matrix in world.items():
        if "camera" in header["nodes"][node]:
            number = header["nodes"][node]["camera"]
            with located(source, f"cameras[{number}]"):
                return _camera(header["cameras"][number], matrix)
    return None


def _camera(stored: dict[str, Any], matrix: Floats) -> Camera:
    target = matrix[:3, 3] - normalize(matrix[:3, 2])
    view: dict[str, Any] = {"position": matrix[:3, 3].tolist(), "target": target.tolist(), "up": matrix[:3, 1].tolist()}
    if stored["type"] == "orthographic":
        return Camera(**view, height=2.0 * stored["orthographic"]["ymag"])
    return Camera(**view, field_of_view=degrees(stored["perspective"]["yfov"]))
