"""Packets of eight rays that leave one point, and go on behind places that let a part of them through.

A ray is traced again from behind each hit until nothing of it is left. Embree may find the triangle of the last hit
again, by a rounding farther: it counts once. So do triangles at the same distance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from obscurance.raytrace import embree
from obscurance.raytrace.embree import LANES, TFAR, EmbreeScene
from obscurance.raytrace.kernel.jit import inline
from obscurance.raytrace.mesh.opacity import PackedOpacity, alpha
from obscurance.raytrace.types import Float32Rows, Int32s

from ..mu import attenuation, depends_on_distance

LEAST = 2.0**-12  # of a ray: what is left of it where it ends
_FARTHER = np.float32(1.0 + 2.0**-23)
_LEAST_T = np.float32(2.0**-126)  # so that a hit at 0 is left behind, too
_TRANSMITTANCE, _OCCLUSION, _BACKFACES, _LAST = range(4)  # rows: what goes on, 1 − μ, what backs end, the last face


class RayPacket(NamedTuple):
    """Eight rays and the Embree scene that they are traced in.

    Attributes:
        scene: uint64, Embree's handle. rays: float32 (22, 8). valid: int32 (8,). See `raytrace.embree`.
        opacity: of the scene's faces, or None.
    """

    scene: np.uint64
    rays: Float32Rows
    valid: Int32s
    opacity: PackedOpacity | None

    @classmethod
    def of(cls, scene: EmbreeScene, opacity: PackedOpacity | None = None) -> RayPacket:
        """A new packet, all lanes valid."""
        return cls(scene.handle, *embree.new_packet(), opacity)


@inline
def start_from(rays, origin):
    """Let all rays of a packet, float32 (22, 8), start at a point."""
    for lane in range(LANES):
        for axis in range(3):
            rays[embree.ORG_X + axis, lane] = origin[axis]


@inline
def aim(rays, local, first_ray, t, b, n, t_max):
    """Turn eight of the directions `local` about +z, (3, samples), into the frame t, b, n; rays of length `t_max`."""
    for lane in range(LANES):
        x = local[0, first_ray + lane]
        y = local[1, first_ray + lane]
        z = local[2, first_ray + lane]
        rays[embree.DIR_X, lane] = x * t[0] + y * b[0] + z * n[0]
        rays[embree.DIR_Y, lane] = x * t[1] + y * b[1] + z * n[1]
        rays[embree.DIR_Z, lane] = x * t[2] + y * b[2] + z * n[2]
        rays[TFAR, lane] = t_max


@inline
def new_alpha_rows(opacity):
    """Room for what the rays of a packet pass; None where all faces are opaque."""
    if opacity is None:
        return None
    return np.zeros((4, LANES))


@inline
def trace(packet, closest, falloff, t_max, lift, alpha_rows):
    """Trace the valid rays of a `RayPacket`.

    Args: closest: whether distances, or backs, matter. lift: of the origin from the place that distances count from.
    """
    if alpha_rows is not None:
        _trace_through(packet, falloff, t_max, lift, alpha_rows)
    elif closest:
        embree.intersect8(packet.scene, packet.rays, packet.valid)
    else:
        embree.occluded8(packet.scene, packet.rays, packet.valid)


@inline
def mu_of(rays, lane, lift, closest, falloff, alpha_rows):
    """μ of a ray that was traced."""
    if alpha_rows is not None:
        return 1.0 - alpha_rows[_OCCLUSION, lane]
    if not closest:
        return 0.0 if rays[TFAR, lane] < 0.0 else 1.0
    if rays.view(np.uint32)[embree.GEOM_ID, lane] == embree.INVALID:
        return 1.0
    return _mu_at(_distance_of(rays, lane, lift), falloff)


@inline
def _distance_of(rays, lane, lift):
    """How far the plane of a hit is, along the ray, from the place that its origin is lifted from; at least 0."""
    ahead = _along_normal(rays, lane, rays[embree.DIR_X, lane], rays[embree.DIR_Y, lane], rays[embree.DIR_Z, lane])
    lifted = _along_normal(rays, lane, lift[0], lift[1], lift[2])
    return max(rays[TFAR, lane] + lifted / ahead, 0.0) if ahead != 0.0 else rays[TFAR, lane]


@inline
def _along_normal(rays, lane, x, y, z):
    """The dot product of a vector and the normal, of any length, of what a ray has hit."""
    return x * rays[embree.NG_X, lane] + y * rays[embree.NG_Y, lane] + z * rays[embree.NG_Z, lane]


@inline
def backface_share(rays, lane, alpha_rows):
    """The part of a ray, traced for the closest hit, that ends on the back of a face."""
    if alpha_rows is not None:
        return alpha_rows[_BACKFACES, lane]
    return 1.0 if rays.view(np.uint32)[embree.GEOM_ID, lane] != embree.INVALID and _is_back(rays, lane) else 0.0


@inline
def _mu_at(distance, falloff):
    """μ of a hit, also of one just beyond the falloff's limit, which Embree may find."""
    if distance >= falloff.limit:
        return 1.0
    return attenuation(distance, falloff) if depends_on_distance(falloff) else 0.0


@inline
def _is_back(rays, lane):
    """Whether a ray has hit the back of a face."""
    x = rays[embree.DIR_X, lane]
    y = rays[embree.DIR_Y, lane]
    z = rays[embree.DIR_Z, lane]
    return _along_normal(rays, lane, x, y, z) > 0.0


@inline
def _trace_through(packet, falloff, t_max, lift, alpha_rows):
    """Trace the valid rays, again and again from behind their last hits, until all have ended or left the scene."""
    rays, valid = packet.rays, packet.valid
    ids = rays.view(np.uint32)
    valid_rays = active_rays = 0
    for lane in range(LANES):
        alpha_rows[_TRANSMITTANCE, lane] = 1.0
        alpha_rows[_OCCLUSION, lane] = 0.0
        alpha_rows[_BACKFACES, lane] = 0.0
        alpha_rows[_LAST, lane] = -1.0
        valid_rays |= -valid[lane] << lane
    active_rays = valid_rays
    while active_rays != 0:
        embree.intersect8(packet.scene, rays, valid)
        for lane in range(LANES):
            if valid[lane] == 0:
                continue
            if ids[embree.GEOM_ID, lane] != embree.INVALID:
                _blend_hit(packet.opacity, falloff, rays, lane, lift, alpha_rows)
                rays[embree.TNEAR, lane] = max(rays[TFAR, lane] * _FARTHER, _LEAST_T)
                rays[TFAR, lane] = t_max
            if ids[embree.GEOM_ID, lane] == embree.INVALID or alpha_rows[_TRANSMITTANCE, lane] <= LEAST:
                valid[lane] = 0
                active_rays &= ~(1 << lane)
    for lane in range(LANES):
        valid[lane] = -(valid_rays >> lane & 1)
        rays[embree.TNEAR, lane] = 0.0


@inline
def _blend_hit(opacity, falloff, rays, lane, lift, alpha_rows):
    """Let a part of a ray end at its hit, by the alpha there."""
    face = np.int64(rays.view(np.uint32)[embree.PRIM_ID, lane])
    if face == alpha_rows[_LAST, lane] or (opacity.one_sided != 0 and _is_back(rays, lane)):
        return
    share = alpha_rows[_TRANSMITTANCE, lane] * alpha(opacity, face, rays[embree.U, lane], rays[embree.V, lane])
    alpha_rows[_TRANSMITTANCE, lane] -= share
    alpha_rows[_OCCLUSION, lane] += share * (1.0 - _mu_at(_distance_of(rays, lane, lift), falloff))
    alpha_rows[_BACKFACES, lane] += share * _is_back(rays, lane)
    alpha_rows[_LAST, lane] = face
