"""The estimator of `ao.rays.gather_packets` with all rays of a point in one traversal of our own hierarchy."""

import numpy as np

from raytrace.kernel.borrow import borrow
from raytrace.kernel.jit import inline, kernel
from raytrace.kernel.simd import WIDE
from raytrace.kernel.simd_masks import lowest_bit
from raytrace.kernel.vector import load

from ..mu import fades
from .directions import choose, turned_frame
from .estimator import BATCHES, write_estimate
from .layers import clear, lost, rays_that_met
from .ray_blocks import init_rays
from .traverse import traverse


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
