"""The estimator: w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) by cosine-weighted directions, eight rays a packet.

With directions of density cosθ/π the integral is the plain mean of μ, so a fully open point is exactly 1.
"""

from __future__ import annotations

import numpy as np

from raytrace.embree.packets import GEOM_ID, INVALID, LANES, TFAR, intersect8, occluded8
from raytrace.kernel.borrow import borrow
from raytrace.kernel.jit import kernel

from ..falloff import exponential_mu
from .directions import BATCHES, choose, turned_frame
from .ray_packet import aim, start_from

W, BATCH_VARIANCE, BENT = range(3)  # columns of rows: w, the variance between batches, the mean of μ·direction
COLUMNS = BENT + 3
VALUES = [W, *range(BENT, COLUMNS)]


@kernel
def gather_hemispheres(packet, points, table, falloff, reach, horizons, traced, out):
    """Estimate the obscurance of n points.

    Args:
        packet: RayPacket. points: PointArrays. table: DirectionTable. falloff: KernelMu.
        reach: length of every ray, at most falloff.limit.
        horizons: float32 (n, 16), slopes above which rays are open and not traced, or (0, 16).
        traced: uint32 (n,), written: rays traced.
        out: float64 (n, COLUMNS), written.
    """
    scene, rays, valid = borrow(packet)
    origins, normals, numbers = borrow(points)
    directions, batches, mean, sectors, slopes, key = borrow(table)
    horizons, traced, out = borrow(horizons), borrow(traced), borrow(out)
    sets, samples = len(directions), len(batches)
    below, batches_below = np.zeros((3, samples + LANES), np.float32), np.zeros(samples + LANES, np.uint8)
    used = min(BATCHES, samples)
    size = np.zeros(BATCHES)
    for k in range(samples):
        size[batches[k]] += 1.0
    lost = np.zeros(BATCHES)
    exponential = falloff.tau > 0.0
    ids = rays.view(np.uint32)
    for i in range(len(origins)):
        chosen, turn = choose(numbers[i], key, sets)
        n = normals[i]
        t, b = turned_frame(n, turn)
        local, of_batch, count = directions[chosen], batches, samples
        if len(horizons):
            count = 0
            for k in range(samples):
                for axis in range(3):
                    below[axis, count] = local[axis, k]
                batches_below[count] = batches[k]
                count += slopes[chosen, k] <= horizons[i, sectors[chosen, k]]
            local, of_batch = below, batches_below
        traced[i] = count
        lost[:] = 0.0
        x = y = z = 0.0
        valid[:] = -1
        start_from(rays, origins[i])
        for first in range(0, count, LANES):
            lanes = min(LANES, count - first)
            valid[lanes:] = 0
            aim(rays, local, first, t, b, n, reach)
            if exponential:
                intersect8(scene, rays, valid)
            else:
                occluded8(scene, rays, valid)
            for lane in range(lanes):
                loss = 1.0  # 1 − μ
                if exponential:
                    if ids[GEOM_ID, lane] == INVALID:
                        continue
                    loss -= exponential_mu(rays[TFAR, lane], falloff)
                elif rays[TFAR, lane] >= 0.0:
                    continue
                lost[of_batch[first + lane]] += loss
                x += loss * local[0, first + lane]
                y += loss * local[1, first + lane]
                z += loss * local[2, first + lane]
        mean_loss = lost.sum() / samples
        spread = 0.0
        for k in range(used):
            spread += (lost[k] / size[k] - mean_loss) ** 2
        out[i, W] = min(max(1.0 - mean_loss, 0.0), 1.0)
        out[i, BATCH_VARIANCE] = spread / (used - 1) if used > 1 else 0.0
        x, y, z = mean[chosen, 0] - x / samples, mean[chosen, 1] - y / samples, mean[chosen, 2] - z / samples
        for axis in range(3):
            out[i, BENT + axis] = x * t[axis] + y * b[axis] + z * n[axis]
