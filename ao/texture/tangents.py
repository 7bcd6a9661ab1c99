"""Tangent frames at texels, for bent normals in tangent space.

Tangents of vertices are made as by Mikkelsen (2008), Simulation of Wrinkled Surfaces Revisited: means of the faces'
directions of u in the vertex's tangent plane, weighted by angle, over corners that share place, normal, coordinates
and handedness.
"""

import numpy as np

from obscurance.raytrace.mesh.normals import normalize
from obscurance.raytrace.types import Bools, Float64s

from .texels import Texels
from .uv_surface import UVSurface, corner_places


def tangent_frames(surface: UVSurface, texels: Texels) -> Float64s:
    """Frames (k, 3, 3) at what texels show: rows x along u, y along v upwards, z the smooth normal, orthonormal."""
    face, weights = texels.page_face, texels.page_barycentric.astype(np.float64)
    axes = _corner_normals(surface)
    mirrored, directions = _directions_of_u(surface)
    tangents = _corner_tangents(surface, axes, mirrored, directions)
    normal = normalize(np.einsum("kc,kcd->kd", weights, axes[face]))
    tangent = np.einsum("kc,kcd->kd", weights, tangents[face])
    tangent = normalize(tangent - np.einsum("kd,kd->k", tangent, normal)[:, None] * normal)
    bitangent = np.cross(normal, tangent) * np.where(mirrored[face], -1.0, 1.0)[:, None]
    return np.stack([tangent, bitangent, normal], axis=1)


def _corner_normals(surface: UVSurface) -> Float64s:
    """Smooth normals (m, 3, 3) at the corners of faces, or the face's where a vertex has none."""
    smooth = surface.smooth
    axes = smooth.axes.axes[surface.receivers.faces]
    of_faces = np.broadcast_to(smooth.surface.normals(np.arange(len(axes)))[:, None], axes.shape)
    return np.where(axes.any(axis=2, keepdims=True), axes, of_faces)


def _directions_of_u(surface: UVSurface) -> tuple[Bools, Float64s]:
    """Whether faces are mirrored on the page (m,), and the unit directions (m, 3) in which u grows on them."""
    uv, corners = surface.layout.uv, surface.vertices[surface.receivers.faces]
    edges = corners[:, 1:] - corners[:, :1]
    on_page = uv[:, 1:] - uv[:, :1]
    u = on_page[..., 0]
    v = -on_page[..., 1]
    mirrored: Bools = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0
    direction = edges[:, 0] * v[:, 1:] - edges[:, 1] * v[:, :1]
    return mirrored, normalize(np.where(mirrored[:, None], -direction, direction))


def _corner_tangents(surface: UVSurface, axes: Float64s, mirrored: Bools, directions: Float64s) -> Float64s:
    """Unit tangents (m, 3, 3) at the corners of faces. Args: axes: of the corners. directions: of u on faces."""
    corners = surface.vertices[surface.receivers.faces]
    flat = normalize(directions[:, None] - np.einsum("fd,fcd->fc", directions, axes)[..., None] * axes)
    ahead = normalize(np.roll(corners, -1, axis=1) - corners)
    behind = normalize(np.roll(corners, -2, axis=1) - corners)
    angles = np.arccos(np.einsum("fcd,fcd->fc", ahead, behind).clip(-1, 1))
    shared = 2 * corner_places(surface.layout.uv, surface.face_points) + mirrored[:, None]
    weighted = (angles[..., None] * flat).reshape(-1, 3)
    sums = np.stack([np.bincount(shared.ravel(), column) for column in weighted.T], axis=1)
    return normalize(sums.astype(np.float64))[shared]
