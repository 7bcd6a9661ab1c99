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
from ..formats.gltf.asset import Gltf, entry
from ..formats.gltf.records import GltfCamera

Floats = npt.NDArray[Any]


def camera(asset: Gltf) -> Camera | None:
    """The first camera among the nodes that are shown, or None.

    Raises:
        MeshError: malformed cameras.
        SceneError: a camera with values out of range.
        ValueError: there is no such camera.
    """
    cameras = asset.stage.cameras
    for node, matrix in asset.world.items():
        number = asset.geometry.nodes[node].camera
        if number is not None:
            with located(asset.path, f"cameras[{number}]"):
                return _camera(entry(cameras, number, "cameras"), matrix)
    return None


def _camera(stored: GltfCamera, matrix: Floats) -> Camera:
    target = matrix[:3, 3] - normalize(matrix[:3, 2])
    view: dict[str, Any] = {"position": matrix[:3, 3].tolist(), "target": target.tolist(), "up": matrix[:3, 1].tolist()}
    if stored.type == "orthographic":
        return Camera(**view, height=2.0 * stored.ymag)
    return Camera(**view, field_of_view=degrees(stored.yfov))
