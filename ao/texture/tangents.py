"""Tangent frames of texels, for bent normals in tangent space: x along u, y along v upwards, z the smooth normal.

Tangents of vertices are made as by Mikkelsen (2008), Simulation of Wrinkled Surfaces Revisited: means of the faces'
directions of u in the vertex's tangent plane, weighted by angle, over corners that share place, normal, coordinates
and handedness.
"""

import numpy as np

from raytrace.mesh.normals import normalize
from raytrace.types import Float64s

from .adjacency import corner_places
from .shown import Shown
from .texels import Texels


def tangent_frames(shown: Shown, texels: Texels) -> Float64s:
    """Frames (k, 3, 3) at what texels show: rows along u, along v and along the normal, orthonormal."""
    uv, faces, face = shown.layout.uv, shown.receivers.faces, texels.shown
    corners = shown.vertices[faces]
    along, up = corners[:, 1:] - corners[:, :1], uv[:, 1:] - uv[:, :1]
    u, v = up[..., 0], -up[..., 1]
    mirrored = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0
    direction = along[:, 0] * v[:, 1:] - along[:, 1] * v[:, :1]
    direction = normalize(np.where(mirrored[:, None], -direction, direction))
    axes = shown.faces.axes[faces]
    unset = ~axes.any(axis=2)
    axes[unset] = np.broadcast_to(shown.faces.surface.normals[:, None], axes.shape)[unset]
    flat = normalize(direction[:, None] - np.einsum("fd,fcd->fc", direction, axes)[..., None] * axes)
    group = 2 * corner_places(uv, shown.points_of_faces) + mirrored[:, None]
    weighted = (_angles(corners)[..., None] * flat).reshape(-1, 3)
    columns = [np.bincount(group.ravel(), column) for column in weighted.T]
    sums: Float64s = np.stack(columns, axis=1).astype(np.float64)
    b = texels.shown_at.astype(np.float64)
    normal = normalize(np.einsum("kc,kcd->kd", b, axes[face]))
    tangent = np.einsum("kc,kcd->kd", b, normalize(sums)[group[face]])
    tangent = normalize(tangent - np.einsum("kd,kd->k", tangent, normal)[:, None] * normal)
    bitangent = np.cross(normal, tangent) * np.where(mirrored[face], -1.0, 1.0)[:, None]
    return np.stack([tangent, bitangent, normal], axis=1)


def _angles(corners: Float64s) -> Float64s:
    ahead, behind = (normalize(np.roll(corners, -step, axis=1) - corners) for step in (1, 2))
    return np.arccos(np.einsum("fcd,fcd->fc", ahead, behind).clip(-1, 1))
