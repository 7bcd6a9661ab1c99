"""Face and vertex normals, shared by the baker and the renderer.

Degenerate faces (zero area) never contribute, and nothing here returns NaN: a normal that does not exist is zero.
Source: Gouraud 1971 (equal), 12.31–12.33; Thürmer & Wüthrich 1998 (angle).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

Weighting = Literal["angle", "area", "equal"]
Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.integer]


def normalize(vectors: Floats) -> Floats:
    """Unit vectors along `vectors` (…, 3); zero, and what is not finite, becomes zero."""
    vectors = np.asarray(vectors, np.float64)
    largest = np.max(np.abs(vectors), axis=-1, keepdims=True)
    usable = np.isfinite(largest) & (largest > 0)
    scaled = np.where(usable, vectors / np.where(usable, largest, 1.0), 0.0)  # no overflow or underflow in the squares
    return scaled / np.where(usable, np.linalg.norm(scaled, axis=-1, keepdims=True), 1.0)


def face_normals(vertices: Floats, faces: Ints) -> tuple[Floats, Floats]:
    """Unit normals (m, 3) and areas (m,) of triangles; both zero for a degenerate face.

    A face is degenerate when its area is zero to rounding: below 4 ulp of the product of its two longest edges.
    """
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    double_area = np.linalg.norm(cross, axis=1)
    edges = np.sort(
        [np.linalg.norm(b - a, axis=1), np.linalg.norm(c - b, axis=1), np.linalg.norm(a - c, axis=1)], axis=0
    )
    solid = double_area > 4 * np.finfo(np.float64).eps * edges[1] * edges[2]
    return normalize(np.where(solid[:, None], cross, 0.0)), np.where(solid, 0.5 * double_area, 0.0)


def corner_angles(vertices: Floats, faces: Ints) -> Floats:
    """Interior angles (m, 3) in radians at each face corner."""
    points = vertices[faces]
    ahead = np.roll(points, -1, axis=1) - points
    behind = np.roll(points, 1, axis=1) - points
    sine = np.linalg.norm(np.cross(ahead, behind), axis=2)
    return np.arctan2(sine, np.einsum("fij,fij->fi", ahead, behind))


def corner_weights(vertices: Floats, faces: Ints, areas: Floats, weighting: Weighting = "angle") -> Floats:
    """Weight (m, 3) of a face's unit normal at each of its corners; zero on degenerate faces.

    equal (12.31), area (12.32), or angle (12.33, which does not change when a face is cut up differently).
    """
    if weighting == "angle":
        weights = corner_angles(vertices, faces)
    else:
        weights = np.repeat((areas if weighting == "area" else np.ones_like(areas))[:, None], 3, axis=1)
    return np.where(areas[:, None] > 0, weights, 0.0)


def vertex_normals(vertices: Floats, faces: Ints, weighting: Weighting = "angle") -> Floats:
    """Unit vertex normals (n, 3); zero where no usable face meets the vertex or its faces cancel out.

    Args: vertices (n, 3) float64, any unit; faces (m, 3) indices.
    """
    normals, areas = face_normals(vertices, faces)
    weights = corner_weights(vertices, faces, areas, weighting)
    return normalize(accumulate(faces.ravel(), (weights[..., None] * normals[:, None]).reshape(-1, 3), len(vertices)))


def accumulate(index: Ints, values: Floats, length: int) -> Floats:
    """Sum of the rows of `values` (k, 3) that share an index: (length, 3). What cancels to rounding is zero."""
    total = np.stack([np.bincount(index, values[:, axis], length) for axis in range(3)], axis=1)
    magnitude = np.bincount(index, np.abs(values).sum(axis=1), length)
    cancelled = np.abs(total).max(axis=1) <= 1e-12 * magnitude
    return np.where(cancelled[:, None], 0.0, total)
