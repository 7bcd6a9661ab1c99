"""A slow baker that shares nothing with the fast one: brute-force intersection and random directions in float64.

Only NumPy: no acceleration structure, no Embree, no low-discrepancy points, its own normals, frames and μ.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

LIFT = 1e-9  # of the mesh's extent; float64 needs no more


@dataclass(frozen=True)
class Reference:
    """w (n,) and its standard error (n,), from the spread of independent rays."""

    w: np.ndarray
    error: np.ndarray


def nearest_hits(origins: np.ndarray, directions: np.ndarray, corners: np.ndarray, fronts: bool = False) -> np.ndarray:
    """Distance (r,) to the nearest of triangles (m, 3, 3) along unit rays (r, 3), or ∞.

    Möller & Trumbore 1997, both sides or fronts alone, all triangles for every ray; their triple products as products
    of matrices.
    """
    centre = corners.mean(axis=(0, 1))
    a, origins = corners[:, 0] - centre, origins - centre
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normals, of_u, of_v = np.cross(e1, e2), np.cross(e2, a), np.cross(a, e1)
    heights = np.einsum("ij,ij->i", a, normals)
    rays = origins, directions, np.cross(origins, directions)
    nearest = []
    for o, d, moments in zip(*(np.array_split(each, len(each) // 512 + 1) for each in rays), strict=True):
        det = -d @ normals.T
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (moments @ e2.T - d @ of_u.T) / det
            v = (-moments @ e1.T - d @ of_v.T) / det
            t = (o @ normals.T - heights) / det
            hit = (det > 0 if fronts else det != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        nearest.append(np.where(hit, t, np.inf).min(axis=1))
    return np.concatenate(nearest)


def angle_weighted_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit vertex normals (n, 3), each face weighted by its angle there (Thürmer & Wüthrich 1998)."""
    normals = np.zeros_like(vertices)
    for face in faces:
        for k in range(3):
            here, ahead, behind = vertices[face[k]], vertices[face[(k + 1) % 3]], vertices[face[(k + 2) % 3]]
            e, f = ahead - here, behind - here
            across = np.cross(e, f)
            size = np.linalg.norm(across)
            normals[face[k]] += across / size * math.atan2(size, e @ f)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def cosine_directions(rng: np.random.Generator, normal: np.ndarray, count: int) -> np.ndarray:
    """Random unit directions (count, 3) of density cosθ/π: the normal plus a uniform point of the unit sphere."""
    sphere = rng.normal(size=(count, 3))
    directions = normal + sphere / np.linalg.norm(sphere, axis=1, keepdims=True)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def falloff(name: str, half_distance: float, limit: float) -> Callable[[np.ndarray], np.ndarray]:
    """μ of distances by its definition, 1 beyond the limit."""

    def mu(distance: np.ndarray) -> np.ndarray:
        x = np.minimum(distance / limit, 1.0) if np.isfinite(limit) else distance
        values = {
            "binary": lambda: np.where(np.isfinite(distance), 0.0, 1.0),
            "linear": lambda: x,
            "smooth": lambda: x * x * (3 - 2 * x),
            "exponential": lambda: (1 - 2 ** -(distance / half_distance)) / (1 - 2 ** -(limit / half_distance)),
        }[name]()
        return np.where(distance < limit, values, 1.0)

    return mu


def mu(distance: np.ndarray, tau: float | None, max_distance: float) -> np.ndarray:
    """Binary for τ = None, else (1 − e^(−τx))/(1 − e^(−τD)) below D and 1 beyond."""
    return falloff("binary" if tau is None else "exponential", math.log(2) / (tau or 1), max_distance)(distance)


def distances(vertices: np.ndarray, faces: np.ndarray, rays: int = 4096, seed: int = 0) -> np.ndarray:
    """Distance (n, rays) to the nearest hit of cosine-weighted rays from every vertex, all of which must have faces."""
    rng = np.random.default_rng(seed)
    normals = angle_weighted_normals(vertices, faces)
    lift = LIFT * np.ptp(vertices, axis=0).max()
    found = np.empty((len(vertices), rays))
    for i, (vertex, normal) in enumerate(zip(vertices, normals, strict=True)):
        directions = cosine_directions(rng, normal, rays)
        origins = np.broadcast_to(vertex + lift * normal, directions.shape)
        found[i] = nearest_hits(origins, directions, vertices[faces])
    return found


def estimate(distances: np.ndarray, tau: float | None, max_distance: float = math.inf) -> Reference:
    """w at every vertex from the distances (n, rays) of its hits."""
    values = mu(distances, tau, max_distance)
    return Reference(values.mean(axis=1), values.std(axis=1, ddof=1) / math.sqrt(distances.shape[1]))


def folded(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The vertices whose angle-weighted normal lies behind one of their own faces."""
    normals = angle_weighted_normals(vertices, faces)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    behind = np.einsum("fkj,fj->fk", normals[faces], across) <= 0
    return np.unique(faces[behind])


def corner_means(
    vertices: np.ndarray,
    faces: np.ndarray,
    which: np.ndarray,
    tau: float | None,
    places: int = 30,
    rays: int = 40,
    seed: int = 0,
) -> np.ndarray:
    """w (k,) at the vertices `which` (k,): the mean over the angles of their corners, of w close by on each face.

    At random directions and distances, a 20th to a 60th of the way to the opposite edge, with the face's own normal.
    """
    rng = np.random.default_rng(seed)
    lift = LIFT * np.ptp(vertices, axis=0).max()
    means = np.empty(len(which))
    for i, vertex in enumerate(which):
        total = angles = 0.0
        for face in faces[(faces == vertex).any(axis=1)]:
            k = int(np.argmax(face == vertex))
            here = vertices[vertex]
            one, other = vertices[face[(k + 1) % 3]] - here, vertices[face[(k + 2) % 3]] - here
            normal = np.cross(one, other)
            angle = math.atan2(np.linalg.norm(normal), one @ other)
            normal /= np.linalg.norm(normal)
            turn = rng.uniform(0, angle, places)[:, None]
            s, t = np.sin(angle - turn) / np.linalg.norm(one), np.sin(turn) / np.linalg.norm(other)
            edge = (s * one + t * other) / (s + t)
            origins = here + edge * rng.uniform(1 / 60, 1 / 20, (places, 1)) + lift * normal
            directions = cosine_directions(rng, normal, places * rays)
            hits = nearest_hits(np.repeat(origins, rays, axis=0), directions, vertices[faces])
            total += angle * mu(hits, tau, math.inf).mean()
            angles += angle
        means[i] = total / angles
    return means
