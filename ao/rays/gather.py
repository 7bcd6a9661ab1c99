"""The estimator: w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) by cosine-weighted directions; the rows that its kernels write.

With directions of density cosθ/π the integral is the plain mean of μ, so a fully open point is exactly 1. All rays of
a point traverse our own hierarchy together (streams), or eight at a time go through Embree (hemispheres); for several
falloffs rays and closest hits are the same, and a hit adds its loss by each falloff to sums of its own (columns).
"""

import numpy as np

from raytrace.embree import packets
from raytrace.embree.packets import LANES
from raytrace.kernel.arrays import borrow
from raytrace.kernel.jit import inline, kernel
from raytrace.kernel.simd import WIDE, lowest_bit
from raytrace.kernel.vector import load

from ..mu import add_losses, fades
from .directions import BATCHES, choose, turned_frame
from .layers import clear, lost, rays_that_met
from .ray_blocks import T_MISS, init_rays
from .ray_packet import aim, mu_of, passed_of, start_from, trace
from .traverse import traverse

W, BATCH_VARIANCE, BENT = range(3)  # columns of rows: w, the variance between batches, the mean of μ·direction
COLUMNS = BENT + 3
VALUES = [W, *range(BENT, COLUMNS)]
_SUMS = BATCHES + 3  # rows: 1 − μ by batches of directions, (1 − μ)·direction


@inline
def write_estimate(out, row, lost, bent, table, chosen, frame):
    """Write a row from what a point's rays have lost.

    Args:
        out: float64 (n, COLUMNS). lost: float64 (BATCHES,), sums of 1 − μ over the batches of directions.
        bent: sum of (1 − μ)·direction. table: DirectionTable, of which set `chosen` was turned into `frame`.
    """
    samples, used = len(table.batches), min(BATCHES, len(table.batches))
    mean_loss = lost.sum() / samples
    spread = 0.0
    for k in range(used):
        spread += (lost[k] / table.batch_sizes[k] - mean_loss) ** 2
    out[row, W] = min(max(1.0 - mean_loss, 0.0), 1.0)
    out[row, BATCH_VARIANCE] = spread / (used - 1) if used > 1 else 0.0
    x, y, z = bent
    mean = table.mean
    x, y, z = mean[chosen, 0] - x / samples, mean[chosen, 1] - y / samples, mean[chosen, 2] - z / samples
    for axis in range(3):
        out[row, BENT + axis] = x * frame[0][axis] + y * frame[1][axis] + z * frame[2][axis]


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


@kernel
def gather_streams(tree, rays, state, points, table, falloff, t_max, out):
    """Estimate the obscurance of n points, as `gather_hemispheres` does with Embree.

    Args:
        tree: BVH16. rays: Rays and state: TraversalState, overwritten; if that has layers, faces have alpha.
        points: PointArrays. table: DirectionTable.
        falloff: KernelMu. t_max: length of every ray, at most falloff.limit.
        out: float64 (n, COLUMNS), written.
    """
    tree, rays, state = borrow(tree), borrow(rays), borrow(state)
    points, table, out = borrow(points), borrow(table), borrow(out)
    batches, samples = table.batches, len(table.batches)
    falloff, t_max = borrow(falloff), np.float32(t_max)
    fading = fades(falloff)
    losses = np.zeros(BATCHES)
    for i in range(len(points.origins)):
        chosen, frame = trace_hemisphere(tree, rays, state, points, i, table, fading, t_max)
        losses[:] = 0.0
        x = y = z = 0.0
        for k in range(len(rays.t_hit)):
            sent = (1 << min(samples - WIDE * k, WIDE)) - 1
            met = rays_that_met(state.layers, rays, k, sent, fading)
            while met != 0:
                ray = WIDE * k + lowest_bit(met)
                met &= met - 1
                loss = lost(state.layers, rays, ray, falloff)
                losses[batches[ray]] += loss
                x += loss * table.directions[chosen, 0, ray]
                y += loss * table.directions[chosen, 1, ray]
                z += loss * table.directions[chosen, 2, ray]
        write_estimate(out, i, losses, (x, y, z), table, chosen, frame)


@inline
def trace_hemisphere(tree, rays, state, points, i, table, fading, t_max):
    """Trace the rays of the i-th of the `points`: the set of directions chosen, and the frame they are turned to."""
    normal = load(points.normals, i)
    chosen, turn = choose(points.numbers[i], table)
    t, b = turned_frame(normal, turn)
    frame = t, b, normal
    init_rays(rays, table.directions, table.cones, chosen, len(table.batches), frame, t_max)
    clear(state.layers)
    traverse(tree, state, rays, load(points.origins, i), normal, table.lowest[chosen], fading, t_max)
    return chosen, frame


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
