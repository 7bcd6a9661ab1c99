"""The estimator: w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) by cosine-weighted directions; the rows that its kernels write.

With directions of density cosθ/π the integral is the plain mean of μ, so a fully open point is exactly 1. All rays of
a point traverse our own hierarchy together; for several falloffs rays and closest hits are the same, and a hit adds its
loss by each falloff to sums of its own (columns).
"""

import numpy as np

from obscurance.raytrace.bvh.bvh16 import BVH16
from obscurance.raytrace.kernel.jit import inline, kernel
from obscurance.raytrace.kernel.simd import WIDE, lowest_bit
from obscurance.raytrace.kernel.vector import load
from obscurance.raytrace.types import Float64Grid

from ..mu import KernelMu, depends_on_distance
from ..points.points import PointArrays
from .directions import BATCHES, DirectionTable, choose, turned_frame
from .layers import clear, hit_mask, write_occlusion
from .ray_blocks import Rays, close_below, count_behind, init_rays
from .traverse import TraversalState, traverse

W, BATCH_VARIANCE, BENT = range(3)  # columns of rows: w, the variance between batches, the mean of μ·direction
COLUMNS = BENT + 3
BEHIND, BELOW = COLUMNS, COLUMNS + 1  # columns of rows that are wider: rays that end on backs, and below `fronts`
WIDER = COLUMNS + 2
_SUMS = BATCHES + 3  # rows: 1 − μ by batches of directions, (1 − μ)·direction


@kernel
def gather_hemispheres(
    tree: BVH16,
    rays: Rays,
    state: TraversalState,
    points: PointArrays,
    table: DirectionTable,
    falloff: KernelMu,
    t_max: float,
    out: Float64Grid,
) -> None:
    """Estimate the obscurance of n points.

    Args:
        rays, state: of `table` and `tree`, written. falloff: of k columns or k = 1.
        t_max: length of every ray, at most falloff.limit unless of columns. out: (n, k, COLUMNS), written; or
            (n, k, WIDER), if rays note `t_sides`.
    """
    reach = np.float32(t_max)
    samples = len(table.batches)
    closest = depends_on_distance(falloff) or len(rays.t_sides) > 0
    sums = np.zeros((_SUMS, out.shape[1]))
    occlusion = np.zeros(out.shape[1])
    for i in range(len(points.origins)):
        normal = load(points.normals, i)
        chosen, turn = choose(points.numbers[i], table)
        t, b = turned_frame(normal, turn)
        # All rays of the point through the tree together.
        init_rays(rays, table.directions, table.cones, chosen, samples, (t, b, normal), reach)
        below = 0
        if len(points.fronts) > 0:
            below = close_below(rays, load(points.fronts, i))
        clear(state.layers)
        start = load(points.origins, i), load(points.lifts, i)
        traverse(tree, state, rays, start, normal, table.lowest[chosen], closest, reach)
        # The 1 − μ of the rays that met something.
        sums[:] = 0.0
        for k in range(len(rays.t_hit)):
            sent = (1 << min(samples - WIDE * k, WIDE)) - 1
            met = hit_mask(state.layers, rays, k, sent, closest)
            while met != 0:
                ray = WIDE * k + lowest_bit(met)
                met &= met - 1
                write_occlusion(state.layers, rays, ray, falloff, falloff.columns, occlusion)
                _add(occlusion, table.batches[ray], table.directions[chosen], ray, sums)
        _write(out[i], sums, table, chosen, (t, b, normal))
        if out.shape[2] == WIDER:
            out[i, :, BEHIND] = count_behind(rays, samples)
            out[i, :, BELOW] = below


@inline
def _add(occlusion, batch, directions, ray, sums):
    """Add a ray's 1 − μ by each falloff to the sum of its batch, and (1 − μ)·direction to those of all rays."""
    x = directions[0, ray]
    y = directions[1, ray]
    z = directions[2, ray]
    for c in range(len(occlusion)):
        loss = occlusion[c]
        sums[batch, c] += loss
        sums[BATCHES, c] += loss * x
        sums[BATCHES + 1, c] += loss * y
        sums[BATCHES + 2, c] += loss * z


@inline
def _write(out, sums, table, chosen, frame):
    """Write a point's rows (k, COLUMNS) from what its rays have lost by each falloff; `chosen`: set of directions."""
    samples = len(table.batches)
    used = min(BATCHES, len(table.batches))
    mean = table.mean
    for c in range(len(out)):
        mean_loss = sums[:BATCHES, c].sum() / samples
        spread = 0.0
        for k in range(used):
            spread += (sums[k, c] / table.batch_sizes[k] - mean_loss) ** 2
        out[c, W] = min(max(1.0 - mean_loss, 0.0), 1.0)
        out[c, BATCH_VARIANCE] = spread / (used - 1) if used > 1 else 0.0
        x = mean[chosen, 0] - sums[BATCHES, c] / samples
        y = mean[chosen, 1] - sums[BATCHES + 1, c] / samples
        z = mean[chosen, 2] - sums[BATCHES + 2, c] / samples
        for axis in range(3):
            out[c, BENT + axis] = x * frame[0][axis] + y * frame[1][axis] + z * frame[2][axis]
