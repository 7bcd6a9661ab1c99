"""Closest hits of rays in arrays, for code that is not a kernel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import OptionError
from ..kernel.jit import kernel
from ..system.threads import run_blocks, thread_count
from ..types import Float32Rows, Float32s, Int32s, Int64s
from .packets import DIR_X, GEOM_ID, INVALID, LANES, ORG_X, PRIM_ID, TFAR, U, V, intersect8, new_packet
from .scene import TriangleScene

_BLOCK, _MOST = 1 << 12, 16  # rays, and blocks at once


@dataclass(frozen=True, eq=False)
class Hits:
    """Closest hits of k rays: `distance` in units of the ray's direction, `face` as row of the scene's, `barycentric`
    weights (k, 3) of its corners; inf, −1 and 0 for a miss."""

    distance: Float32s
    face: Int64s
    barycentric: Float32s


@kernel
def _closest(
    scene: np.uint64,
    traced: tuple[Float32Rows, Int32s],
    rays: tuple[Float32Rows, Float32Rows, Float32s],
    hits: tuple[Float32s, Int64s, Float32Rows],
    begin: int,
    end: int,
) -> None:
    """Trace the rays from `begin` to `end` in packets of eight, and write what they hit.

    Args:
        traced: of `new_packet`.
        rays: origins (k, 3), directions (k, 3), reach (k,).
        hits: arrays as of `Hits`, written.
    """
    (packet, valid), (origins, directions, reach), (distance, face, barycentric) = traced, rays, hits
    ids = packet.view(np.uint32)
    for first_ray in range(begin, end, LANES):
        for lane in range(LANES):
            ray = min(first_ray + lane, end - 1)
            valid[lane] = -1 if first_ray + lane < end else 0
            for axis in range(3):
                packet[ORG_X + axis, lane] = origins[ray, axis]
                packet[DIR_X + axis, lane] = directions[ray, axis]
            packet[TFAR, lane] = reach[ray]
        intersect8(scene, packet, valid)
        for lane in range(min(LANES, end - first_ray)):
            if ids[GEOM_ID, lane] != INVALID:
                ray = first_ray + lane
                distance[ray] = packet[TFAR, lane]
                face[ray] = ids[PRIM_ID, lane]
                u = packet[U, lane]
                v = packet[V, lane]
                barycentric[ray, 0] = np.float32(1.0) - u - v
                barycentric[ray, 1] = u
                barycentric[ray, 2] = v


def intersect(
    scene: TriangleScene, origins: Any, directions: Any, reach: Any = np.inf, threads: int | None = None
) -> Hits:
    """Closest hits of rays with 0 ≤ distance ≤ reach.

    Args: origins, directions: broadcast to (k, 3), rounded to float32; scene units; directions of any length but zero.
        reach: broadcasts to (k,), in units of the direction's length.
    Raises: OptionError: wrong shapes, or values that Embree would take for a miss: NaN, infinity, zero directions.
    """
    origins, directions = np.broadcast_arrays(origins, directions)
    origins = np.ascontiguousarray(origins, np.float32)
    directions = np.ascontiguousarray(directions, np.float32)
    if origins.ndim != 2 or origins.shape[1] != 3:
        raise OptionError("origins, directions", "shapes that broadcast to (k, 3)", origins.shape)
    if not (np.isfinite(origins).all() and np.isfinite(directions).all() and directions.any(axis=1).all()):
        raise OptionError("origins, directions", "finite origins and finite directions that are not zero", "others")
    count = len(origins)
    rays = origins, directions, np.ascontiguousarray(np.broadcast_to(np.float32(reach), count))
    hits = np.full(count, np.inf, np.float32), np.full(count, -1), np.zeros((count, 3), np.float32)

    def work(start: int, stop: int) -> None:
        _closest(scene.handle, new_packet(), rays, hits, start, stop)

    run_blocks(count, _BLOCK, work, thread_count(threads), most=_MOST)
    return Hits(*hits)
