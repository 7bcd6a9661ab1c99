"""Packets of eight rays that leave one point, as gathering kernels fill them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from raytrace.embree.packets import DIR_X, DIR_Y, DIR_Z, LANES, ORG_X, ORG_Y, ORG_Z, TFAR, new_packet
from raytrace.embree.scene import EmbreeScene
from raytrace.kernel.jit import inline
from raytrace.mesh.opacity import PackedOpacity
from raytrace.types import Float32s, Int32s


class RayPacket(NamedTuple):
    """Eight rays and the Embree scene that they are traced in.

    Attributes:
        scene: uint64, Embree's handle. rays: float32 (22, 8). valid: int32 (8,). See `raytrace.embree.packets`.
        opacity: of the scene's faces, or None.
    """

    scene: np.uint64
    rays: Float32s
    valid: Int32s
    opacity: PackedOpacity | None

    @classmethod
    def of(cls, scene: EmbreeScene, opacity: PackedOpacity | None = None) -> RayPacket:
        """A new packet, all lanes valid."""
        return cls(scene.handle, *new_packet(), opacity)


@inline
def start_from(rays, origin):
    """Let all rays of a packet, float32 (22, 8), start at a point."""
    for lane in range(LANES):
        rays[ORG_X, lane], rays[ORG_Y, lane], rays[ORG_Z, lane] = origin[0], origin[1], origin[2]


@inline
def aim(rays, local, first, t, b, n, t_max):
    """Turn eight of the directions `local` about +z, (3, samples), into the frame t, b, n; rays of length `t_max`."""
    for lane in range(LANES):
        x, y, z = local[0, first + lane], local[1, first + lane], local[2, first + lane]
        rays[DIR_X, lane] = x * t[0] + y * b[0] + z * n[0]
        rays[DIR_Y, lane] = x * t[1] + y * b[1] + z * n[1]
        rays[DIR_Z, lane] = x * t[2] + y * b[2] + z * n[2]
        rays[TFAR, lane] = t_max
