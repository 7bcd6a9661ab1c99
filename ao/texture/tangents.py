"""Tangent frames of texels, for bent normals in tangent space: x along u, y along v upwards, z the smooth normal.

Tangents of vertices are made as by Mikkelsen (2008), Simulation of Wrinkled Surfaces Revisited: means of the faces'
directions of u in the vertex's tangent plane, weighted by angle, over corners that share place, normal, coordinates
and handedness.
"""

import numpy as np

from raytrace.mesh.normals import normalize
from raytrace.types import Float32s, Float64s, Int32s, Int64s

from .adjacency import corner_places
from .texels import Faces


def tangent_frames(
    uv: Float64s, faces: Int64s, points: Int64s, mesh: Faces, face: Int32s, weights: Float32s
) -> Float64s:
    """Frames (k, 3, 3) at places on faces: rows along u, along v and along the normal, orthonormal.

    Args:
        uv: (m, 3, 2), in texels, y downwards. faces: (m, 3), rows of `mesh.vertices`. points: (m, 3), welded.
        face: (k,), weights: (k, 3): the places.
    """
    corners = mesh.vertices[faces]
    along, up = corners[:, 1:] - corners[:, :1], uv[:, 1:] - uv[:, :1]
    u, v = up[..., 0], -up[..., 1]
    mirrored = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0
    direction = along[:, 0] * v[:, 1:] - along[:, 1] * v[:, :1]
    direction = normalize(np.where(mirrored[:, None], -direction, direction))
    axes = mesh.axes[faces]
    unset = ~axes.any(axis=2)
    axes[unset] = np.broadcast_to(mesh.surface.normals[:, None], axes.shape)[unset]
    flat = normalize(direction[:, None] - np.einsum("fd,fcd->fc", direction, axes)[..., None] * axes)
    group = 2 * corner_places(uv, points) + mirrored[:, None]
    weighted = (_angles(corners)[..., None] * flat).reshape(-1, 3)
    columns = [np.bincount(group.ravel(), column) for column in weighted.T]
    sums: Float64s = np.stack(columns, axis=1).astype(np.float64)
    b = weights.astype(np.float64)
    normal = normalize(np.einsum("kc,kcd->kd", b, axes[face]))
    tangent = np.einsum("kc,kcd->kd", b, normalize(sums)[group[face]])
    tangent = normalize(tangent - np.einsum("kd,kd->k", tangent, normal)[:, None] * normal)
    bitangent = np.cross(normal, tangent) * np.where(mirrored[face], -1.0, 1.0)[:, None]
    return np.stack([tangent, bitangent, normal], axis=1)


def _angles(corners: Float64s) -> Float64s:
    ahead, behind = (normalize(np.roll(corners, -step, axis=1) - corners) for step in (1, 2))
    return np.arccos(np.einsum("fcd,fcd->fc", ahead, behind).clip(-1, 1))
