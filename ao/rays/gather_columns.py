"""The estimator for several falloffs at once: `gather_streams` and `gather_hemispheres` with a row for each of them.

Rays and closest hits are the same for all; a hit adds its loss by each falloff to sums of its own.
"""

import numpy as np

from raytrace.embree import packets
from raytrace.kernel.borrow import borrow
from raytrace.kernel.jit import inline, kernel
from raytrace.kernel.simd import WIDE
from raytrace.kernel.simd_masks import lowest_bit

from ..mu import add_losses
from .directions import BATCHES, choose, turned_frame
from .estimator import write_estimate
from .gather_streams import trace_hemisphere
from .layers import rays_that_met
from .passing import trace
from .ray_blocks import T_MISS
from .ray_packet import aim, start_from

_SUMS = BATCHES + 3  # rows: 1 − μ by batches of directions, (1 − μ)·direction


@kernel
def gather_columns(tree, rays, state, points, table, columns, t_max, out):
    """Estimate the obscurance of n points by k falloffs, as `gather_streams` does by one.

    Args:
        columns: KernelColumns. t_max: length of every ray, the largest limit at most.
        out: float64 (n, k, COLUMNS), written. All else as for `gather_streams`.
    """
    tree, rays, state = borrow(tree), borrow(rays), borrow(state)
    points, table, columns = borrow(points), borrow(table), borrow(columns)
    out, t_max = borrow(out), np.float32(t_max)
    samples, count = len(table.batches), len(columns.taus)
    sums, losses = np.zeros((_SUMS, count)), np.zeros(count)
    for i in range(len(points.origins)):
        chosen, frame = trace_hemisphere(tree, rays, state, points, i, table, True, t_max)
        sums[:] = 0.0
        for k in range(len(rays.t_hit)):
            sent = (1 << min(samples - WIDE * k, WIDE)) - 1
            met = rays_that_met(state.layers, rays, k, sent, True)
            while met != 0:
                ray = WIDE * k + lowest_bit(met)
                met &= met - 1
                losses[:] = 0.0
                left = _pass_layers(state.layers, rays, ray, columns, losses)
                t_hit = rays.t_hit[ray // WIDE, ray % WIDE]
                if t_hit < T_MISS:
                    add_losses(columns, t_hit, left, losses)
                _add(losses, table.batches[ray], table.directions[chosen], ray, sums)
        _write(out[i], sums, table, chosen, frame)


@kernel
def gather_columns_by_packets(packet, points, table, columns, t_max, out):
    """`gather_columns` by Embree, as `gather_hemispheres` is `gather_streams`; of opaque faces."""
    packet, points, table = borrow(packet), borrow(points), borrow(table)
    columns, out = borrow(columns), borrow(out)
    rays, valid, origins = packet.rays, packet.valid, points.origins
    samples, count = len(table.batches), len(columns.taus)
    sums, losses = np.zeros((_SUMS, count)), np.zeros(count)
    for i in range(len(origins)):
        chosen, turn = choose(points.numbers[i], table)
        n, local = points.normals[i], table.directions[chosen]
        t, b = turned_frame(n, turn)
        sums[:] = 0.0
        valid[:] = -1
        start_from(rays, origins[i])
        for first in range(0, samples, packets.LANES):
            lanes = min(packets.LANES, samples - first)
            valid[lanes:] = 0
            aim(rays, local, first, t, b, n, t_max)
            trace(packet, True, None, t_max, None)
            for lane in range(lanes):
                if rays.view(np.uint32)[packets.GEOM_ID, lane] != packets.INVALID:
                    losses[:] = 0.0
                    add_losses(columns, rays[packets.TFAR, lane], 1.0, losses)
                    _add(losses, table.batches[first + lane], local, first + lane, sums)
        _write(out[i], sums, table, chosen, (t, b, n))


@inline
def _pass_layers(layers, rays, ray, columns, losses):
    """Add what a ray loses to the layers before its hit; the part of it that goes on, see `layers.lost`."""
    left = 1.0
    if layers is not None:
        for layer in range(layers.counts[ray]):
            distance, found = layers.distances[ray, layer], np.float64(layers.alphas[ray, layer])
            if distance >= rays.t_hit[ray // WIDE, ray % WIDE]:
                break
            add_losses(columns, distance, left * found, losses)
            left *= 1.0 - found
    return left


@inline
def _add(losses, batch, directions, ray, sums):
    x, y, z = directions[0, ray], directions[1, ray], directions[2, ray]
    for c in range(len(losses)):
        loss = losses[c]
        sums[batch, c] += loss
        sums[BATCHES, c] += loss * x
        sums[BATCHES + 1, c] += loss * y
        sums[BATCHES + 2, c] += loss * z


@inline
def _write(out, sums, table, chosen, frame):
    for c in range(len(out)):
        bent = sums[BATCHES, c], sums[BATCHES + 1, c], sums[BATCHES + 2, c]
        write_estimate(out, c, sums[:BATCHES, c], bent, table, chosen, frame)
