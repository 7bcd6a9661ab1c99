"""The estimator: w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) by cosine-weighted directions, eight rays a packet of Embree's.

With directions of density cosθ/π the integral is the plain mean of μ, so a fully open point is exactly 1.
"""

import numpy as np

from raytrace.embree.packets import LANES
from raytrace.kernel.borrow import borrow
from raytrace.kernel.jit import kernel

from ..mu import fades
from .directions import BATCHES, choose, turned_frame
from .estimator import write_estimate
from .passing import mu_of, passed_of, trace
from .ray_packet import aim, start_from


@kernel
def gather_hemispheres(packet, points, table, falloff, t_max, out):
    """Estimate the obscurance of n points.

    Args:
        packet: RayPacket. points: PointArrays. table: DirectionTable. falloff: KernelMu.
        t_max: length of every ray, at most falloff.limit.
        out: float64 (n, COLUMNS), written.
    """
    packet, points, table, out = borrow(packet), borrow(points), borrow(table), borrow(out)
    rays, valid, origins = packet.rays, packet.valid, points.origins
    batches, samples = table.batches, len(table.batches)
    losses, passed = np.zeros(BATCHES), passed_of(packet.opacity)
    falloff = borrow(falloff)
    fading = fades(falloff)
    for i in range(len(origins)):
        chosen, turn = choose(points.numbers[i], table)
        n = points.normals[i]
        t, b = turned_frame(n, turn)
        local = table.directions[chosen]
        losses[:] = 0.0
        x = y = z = 0.0
        valid[:] = -1
        start_from(rays, origins[i])
        for first in range(0, samples, LANES):
            lanes = min(LANES, samples - first)
            valid[lanes:] = 0
            aim(rays, local, first, t, b, n, t_max)
            trace(packet, fading, falloff, t_max, passed)
            for lane in range(lanes):
                loss = 1.0 - mu_of(rays, lane, fading, falloff, passed)
                if loss == 0.0:
                    continue
                losses[batches[first + lane]] += loss
                x += loss * local[0, first + lane]
                y += loss * local[1, first + lane]
                z += loss * local[2, first + lane]
        write_estimate(out, i, losses, (x, y, z), table, chosen, (t, b, n))
