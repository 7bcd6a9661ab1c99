"""The estimator: w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) by cosine-weighted directions; the rows that its kernels write.

With directions of density cosθ/π the integral is the plain mean of μ, so a fully open point is exactly 1. All rays of
a point traverse our own hierarchy together (streams), or eight at a time go through Embree (hemispheres); for several
falloffs rays and closest hits are the same, and a hit adds its loss by each falloff to sums of its own (columns).
"""

import numpy as np

from obscurance.raytrace.bvh.bvh16 import BVH16
from obscurance.raytrace.embree.packets import GEOM_ID, INVALID, LANES
from obscurance.raytrace.kernel.jit import inline, kernel
from obscurance.raytrace.kernel.simd import WIDE, lowest_bit
from obscurance.raytrace.kernel.vector import load
from obscurance.raytrace.types import Float64Grid

from ..mu import KernelMu, accumulate_occlusion, depends_on_distance
from ..points.points import PointArrays
from .directions import BATCHES, DirectionTable, choose, turned_frame
from .layers import clear, hit_mask, write_occlusion
from .ray_blocks import Rays, init_rays
from .ray_packet import RayPacket, aim, distance_of, mu_of, new_alpha_rows, start_from, trace
from .traverse import TraversalState, traverse

W, BATCH_VARIANCE, BENT = range(3)  # columns of rows: w, the variance between batches, the mean of μ·direction
COLUMNS = BENT + 3
VALUES = [W, *range(BENT, COLUMNS)]
_SUMS = BATCHES + 3  # rows: 1 − μ by batches of directions, (1 − μ)·direction


@kernel
def gather_hemispheres(
    packet: RayPacket, points: PointArrays, table: DirectionTable, falloff: KernelMu, t_max: float, out: Float64Grid
) -> None:
    """Estimate the obscurance of n points by Embree.

    Args:
        packet: of opaque faces if there are columns. falloff: of k columns or k = 1.
        t_max: length of every ray, at most falloff.limit. out: (n, k, COLUMNS), written.
    """
    rays, valid, origins = packet.rays, packet.valid, points.origins
    samples = len(table.batches)
    alpha_rows = new_alpha_rows(packet.opacity)
    # Distances count from the place, see `distance_of`.
    closest = depends_on_distance(falloff) or t_max >= falloff.limit
    sums = np.zeros((_SUMS, out.shape[1]))
    occlusion = np.zeros(out.shape[1])
    for i in range(len(origins)):
        chosen, turn = choose(points.numbers[i], table)
        n = points.normals[i]
        local = table.directions[chosen]
        t, b = turned_frame(n, turn)
        # A packet of rays at a time: each ray's 1 − μ goes into the point's sums.
        sums[:] = 0.0
        valid[:] = -1
        lift = points.lifts[i]
        start_from(rays, origins[i])
        for first_ray in range(0, samples, LANES):
            lanes = min(LANES, samples - first_ray)
            valid[lanes:] = 0
            aim(rays, local, first_ray, t, b, n, t_max)
            trace(packet, closest, falloff, t_max, lift, alpha_rows)
            for lane in range(lanes):
                if _write_lane_occlusion(rays, lane, lift, closest, falloff, falloff.columns, alpha_rows, occlusion):
                    _add(occlusion, table.batches[first_ray + lane], local, first_ray + lane, sums)
        _write(out[i], sums, table, chosen, (t, b, n))


@inline
def _write_lane_occlusion(rays, lane, lift, closest, falloff, columns, alpha_rows, occlusion):
    """Write 1 − μ of a ray of a packet by each falloff; returns whether any is above 0."""
    if columns is None:
        occlusion[0] = 1.0 - mu_of(rays, lane, lift, closest, falloff, alpha_rows)
        return occlusion[0] != 0.0
    if rays.view(np.uint32)[GEOM_ID, lane] == INVALID:
        return False
    occlusion[:] = 0.0
    accumulate_occlusion(columns, distance_of(rays, lane, lift), 1.0, occlusion)
    return True


@kernel
def gather_streams(
    tree: BVH16,
    rays: Rays,
    state: TraversalState,
    points: PointArrays,
    table: DirectionTable,
    falloff: KernelMu,
    t_max: float,
    out: Float64Grid,
) -> None:
    """`gather_hemispheres` by a BVH16."""
    reach = np.float32(t_max)
    samples = len(table.batches)
    fading = depends_on_distance(falloff)
    sums = np.zeros((_SUMS, out.shape[1]))
    occlusion = np.zeros(out.shape[1])
    for i in range(len(points.origins)):
        normal = load(points.normals, i)
        chosen, turn = choose(points.numbers[i], table)
        t, b = turned_frame(normal, turn)
        # All rays of the point through the tree together.
        init_rays(rays, table.directions, table.cones, chosen, samples, (t, b, normal), reach)
        clear(state.layers)
        start = load(points.origins, i), load(points.lifts, i)
        traverse(tree, state, rays, start, normal, table.lowest[chosen], fading, reach)
        # The 1 − μ of the rays that met something.
        sums[:] = 0.0
        for k in range(len(rays.t_hit)):
            sent = (1 << min(samples - WIDE * k, WIDE)) - 1
            met = hit_mask(state.layers, rays, k, sent, fading)
            while met != 0:
                ray = WIDE * k + lowest_bit(met)
                met &= met - 1
                write_occlusion(state.layers, rays, ray, falloff, falloff.columns, occlusion)
                _add(occlusion, table.batches[ray], table.directions[chosen], ray, sums)
        _write(out[i], sums, table, chosen, (t, b, normal))


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
