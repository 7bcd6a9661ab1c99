"""World transforms of the nodes of a glTF scene.

Format: Khronos glTF 2.0 specification, section 3.5.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from raytrace.mesh.up import TO_Y_UP
from raytrace.types import Float64s

from ...geometry.instances import world_matrices
from .container import roots

_PLACED = {"matrix", "translation", "rotation", "scale"}


def node_matrices(header: dict[str, Any]) -> dict[int, Float64s]:
    """The (4, 4) map to the world of every node that the default scene shows, depth first, children in their order.

    Raises:
        Exception: nodes that are malformed or no tree.
    """
    nodes = header.get("nodes", [])
    edges: list[dict[str, Any]] = []
    stack = [(-1, number) for number in reversed(roots(header))]
    while stack:
        parent, number = stack.pop()
        if len(edges) >= len(nodes):
            raise ValueError("the nodes are no tree")
        edge = {"frame_to": number, "frame_from": parent}
        edges.append(edge if _PLACED.isdisjoint(nodes[number]) else edge | {"matrix": _local(nodes[number])})
        stack.extend((number, child) for child in reversed(nodes[number].get("children", [])))
    world = world_matrices(edges, -1)
    return {edge["frame_to"]: world[edge["frame_to"]] for edge in edges}


def stand(header: dict[str, Any], up: str) -> None:
    """Put the roots of the default scene below a node that turns `up` to y, glTF's up axis, if it is another."""
    if up == "y":
        return
    matrix = np.eye(4)
    matrix[:3, :3] = TO_Y_UP[up]
    nodes = header["nodes"]
    nodes.append({"name": f"{up} up", "matrix": matrix.T.ravel().tolist(), "children": roots(header)})
    header.setdefault("scenes", [{}])[header.setdefault("scene", 0)]["nodes"] = [len(nodes) - 1]


def _local(node: dict[str, Any]) -> Float64s:
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    made = np.eye(4)
    if "rotation" in node:
        from scipy.spatial.transform import Rotation  # loads for a fifth of a second

        made[:3, :3] = Rotation.from_quat(node["rotation"]).as_matrix()
    made[:3, :3] *= node.get("scale", 1.0)
    made[:3, 3] = node.get("translation", 0.0)
    return made
