"""Face and vertex normals, shared by the baker and the renderer.

Degenerate faces (zero area) never contribute, and nothing here returns NaN: a normal that does not exist is zero.
Source: Gouraud 1971 (equal), 12.31–12.33; Thürmer & Wüthrich 1998 (angle).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from ..kernel.jit import inline, kernel
from ..system.threads import run_blocks, thread_count

_BLOCK = 1 << 15  # faces
EPSILON = float(np.finfo(np.float64).eps)
Weighting = Literal["angle", "area", "equal"]
Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.integer]


def normalize(vectors: Floats) -> Floats:
    """Unit vectors along `vectors` (…, 3); zero, and what is not finite, becomes zero."""
    vectors = np.asarray(vectors, np.float64)
    out = np.zeros(vectors.shape)
    _normalize(np.ascontiguousarray(vectors).reshape(-1, 3), out.reshape(-1, 3))
    return out


def given(vectors: Floats) -> npt.NDArray[np.bool_]:
    """Which of the `vectors` (n, 3) are not zero, (n,)."""
    x, y, z = vectors.T
    return (x != 0) | (y != 0) | (z != 0)


def face_normals(vertices: Floats, faces: Ints) -> tuple[Floats, Floats]:
    """Unit normals (m, 3) and areas (m,) of triangles; both zero for a degenerate face.

    A face is degenerate when its area is zero to rounding: below 4 ulp of the product of its two longest edges.
    """
    normals, areas = np.zeros((len(faces), 3)), np.zeros(len(faces))
    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)

    def work(first: int, last: int) -> None:
        _face_normals(vertices, faces[first:last], normals[first:last], areas[first:last])

    run_blocks(len(faces), _BLOCK, work, thread_count(None))
    return normals, areas


def vertex_sums(
    vertices: Floats, faces: Ints, normals: Floats, areas: Floats, weighting: Weighting = "angle"
) -> Floats:
    """Weighted sums (n, 3) of the unit face normals at each vertex, zero where they cancel to rounding.

    Weights: equal (12.31), area (12.32), or interior angle (12.33, which does not change when a face is cut up).
    Args: `normals` and `areas` as `face_normals` gives them.
    """
    sums, magnitude = np.zeros((len(vertices), 3)), np.zeros(len(vertices))
    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)
    weights = np.ones((len(faces), 3))  # (12.31)
    if weighting == "area":
        weights *= areas[:, None]  # (12.32)
    elif weighting == "angle":

        def measure(first: int, last: int) -> None:
            _angles(vertices, faces[first:last], areas[first:last], weights[first:last])

        run_blocks(len(faces), _BLOCK, measure, thread_count(None))
    _vertex_sums(faces, normals, areas, weights, sums, magnitude)
    return sums


def vertex_normals(vertices: Floats, faces: Ints, weighting: Weighting = "angle") -> Floats:
    """Unit vertex normals (n, 3); zero where no usable face meets the vertex or its faces cancel out.

    Args: vertices (n, 3) float64, any unit; faces (m, 3) indices.
    """
    return normalize(vertex_sums(vertices, faces, *face_normals(vertices, faces), weighting))


@inline
def _edge(vertices, a, b):
    return vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]


@inline
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def _normalize(vectors, out):
    for i in range(len(vectors)):
        x, y, z = vectors[i, 0], vectors[i, 1], vectors[i, 2]
        largest = max(abs(x), abs(y), abs(z))
        if largest > 0.0 and np.isfinite(x) and np.isfinite(y) and np.isfinite(z):
            x, y, z = x / largest, y / largest, z / largest  # no overflow or underflow in the squares
            length = np.sqrt(x * x + y * y + z * z)
            out[i, 0], out[i, 1], out[i, 2] = x / length, y / length, z / length


@kernel
def _face_normals(vertices, faces, normals, areas):
    for f in range(len(faces)):
        i, j, k = faces[f]
        a, b, c = _edge(vertices, i, j), _edge(vertices, j, k), _edge(vertices, k, i)
        cross = _cross(a, b)
        double = np.sqrt(_dot(cross, cross))
        aa, bb, cc = _dot(a, a), _dot(b, b), _dot(c, c)
        shortest = min(aa, bb, cc)
        longest = np.sqrt(aa * bb if shortest == cc else (bb * cc if shortest == aa else cc * aa))
        if double > 4.0 * EPSILON * longest:
            areas[f] = 0.5 * double
            for axis in range(3):
                normals[f, axis] = cross[axis] / double


@kernel
def _angles(vertices, faces, areas, out):
    """Interior angles (12.33)."""
    for f in range(len(faces)):
        for corner in range(3):
            i, j, k = faces[f, corner], faces[f, (corner + 1) % 3], faces[f, (corner + 2) % 3]
            out[f, corner] = np.arctan2(2.0 * areas[f], _dot(_edge(vertices, i, j), _edge(vertices, i, k)))


@kernel
def _vertex_sums(faces, normals, areas, weights, sums, magnitude):
    for f in range(len(faces)):
        if areas[f] > 0.0:
            for corner in range(3):
                i = faces[f, corner]
                magnitude[i] += weights[f, corner]
                for axis in range(3):
                    sums[i, axis] += weights[f, corner] * normals[f, axis]
    for i in range(len(sums)):
        if max(abs(sums[i, 0]), abs(sums[i, 1]), abs(sums[i, 2])) <= 1e-12 * magnitude[i]:
            sums[i] = 0.0
