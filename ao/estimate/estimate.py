"""The one way from points to their values: vertices, texels, points of a fine mesh alike.

Points with a hemisphere of their own are traced, folded points get the mean over their `CornerSamples`, and points
inside solids the values of the nearest points outside.
"""

import hashlib
from collections.abc import Callable

import numpy as np

from obscurance.raytrace.sampling import hash32_array, seed_key
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import Bools, Float64s, Int32Rows, Int32s, Int64Rows, Int64s

from ..execute.tracer import Tracer
from ..options import Options
from ..points.corners import CornerSamples
from ..points.points import Points
from ..rays.gather import BATCH_VARIANCE, BENT, VALUES, W
from .calibration import Calibration, calibration_factor, distribute_variance, shrunk_to_mean
from .cells import Cells, nearest_baked
from .one_ring import Neighbours, NeighboursOf
from .sampling_error import derive, rays_alone, sampling_variance
from .scales import denoise_over_scales
from .tolerance import Estimate, estimate_to
from .upsampling import extrapolate

_CALIBRATION_SHARE = 32
_CALIBRATION_LEAST = 128
_CORNER_SHARE = 8  # of a point's rays, for each of some 18 corner samples, whose mean errs as much as a point's w
_CORNER_SHARE_DENOISED = 3  # where the points are denoised


def traced_twice(
    tracer: Tracer, points: Points, samples: int, key: np.uint32, later: int = 0
) -> Callable[[Neighbours | None], Estimate]:
    """Trace `points`, some twice to calibrate the error; returns a function that makes estimates of what was traced,
    denoised if it is given neighbours.

    Args: later: rays that are to follow, for who watches the progress.
    """
    calibration = _calibration_subset(len(points))
    tracer.expected = tracer.rays + samples * (len(points) + len(calibration)) + later
    gathered = tracer.gather(points, samples, key)
    checked = points[calibration]
    second_key = hash32_array([key ^ np.uint32(0xA5A5A5A5)])[0]
    second = tracer.gather(checked, samples, second_key)
    reference = tracer.gather_elsewhere(checked, samples, derive(second_key, 1), second)[:, W]
    rays = tracer.rays
    weight = np.full(len(calibration), len(points) / max(len(calibration), 1))

    def estimated(neighbours: Neighbours | None) -> Estimate:
        w = gathered[:, W]
        spread = gathered[:, BATCH_VARIANCE]
        level = sampling_variance(w[calibration], second[:, W], samples)
        placement = sampling_variance(w[calibration], reference, samples) - level  # of samples in a texel or a face
        placement = max(placement, 0.0)
        if len(points) and not spread.any() and (w == w[0]).all():  # of n rays that agree, the next may not (Laplace)
            level = min(level, rays**-2.0)
        variance = shrunk_to_mean(distribute_variance(spread, level)) + placement
        before = (w[calibration] - reference) ** 2
        raw_calibration = Calibration(variance[calibration], before / 2, weight)
        raw = Estimate(gathered.take(VALUES, axis=1), variance, samples, calibration=raw_calibration)
        if neighbours is None:
            return raw

        def risk(w: Float64s) -> float:
            return float(np.mean((w - reference) ** 2))

        denoised, error = denoise_over_scales(neighbours, points, gathered.astype(np.float32), level, calibration, risk)
        after = (denoised[calibration] - reference) ** 2
        if float(np.sum(after - before)) >= 0:
            return raw
        error += placement
        error *= calibration_factor(error[calibration], after - before / 2, error)
        measured = Calibration(error[calibration], after - before / 2, weight)
        return Estimate(np.column_stack([denoised, gathered[:, BENT:]]), error, samples, calibration=measured)

    return estimated


def rays_per_corner_sample(samples: int, denoised: bool) -> int:
    """Rays of each corner sample where ordinary points get `samples` rays."""
    return -(-samples // (_CORNER_SHARE_DENOISED if denoised else _CORNER_SHARE))


def _calibration_subset(count: int) -> Int64s:
    """Evenly spread points to bake a second time with independent directions: one in 32, 128 at least."""
    wanted = min(count, max(_CALIBRATION_LEAST, count // _CALIBRATION_SHARE))
    return np.arange(wanted) * count // max(wanted, 1)


def edges_of(points: Points, of_vertex: Int64s, faces: Int64s, tracer: Tracer) -> NeighboursOf:
    """Neighbours along the edges of `faces` (m, 3), kept where several falloffs need the same.

    Args: of_vertex: (n,), the row in `points` of each vertex, −1 for none.
    """
    kept = dict[bytes, Neighbours]()

    def among(point_rows: Int64s) -> Neighbours:
        if not tracer.mu.columns:
            return made(point_rows)
        digest = hashlib.blake2b(point_rows.data).digest()
        return kept.get(digest) or kept.setdefault(digest, made(point_rows))

    def made(point_rows: Int64s) -> Neighbours:
        """The neighbours among the points of these rows."""
        row_of_point = np.full(len(points) + 1, -1, np.int32)  # the last for vertices without a point
        row_of_point[point_rows] = np.arange(len(point_rows), dtype=np.int32)
        corners = np.empty(faces.shape, np.int32)
        _look_up.on(tracer.threads)(row_of_point[of_vertex], faces, corners)
        return Neighbours.of(corners, points.normals[point_rows], tracer.threads)

    return among


@each("faces")
def _look_up(f: int, row_of_vertex: Int32s, faces: Int64Rows, corners: Int32Rows) -> None:
    for k in range(3):
        corners[f, k] = row_of_vertex[faces[f, k]]


def estimate(
    tracer: Tracer, points: Points, corners: CornerSamples, neighbours_of: NeighboursOf, options: Options
) -> Estimate:
    """Estimates at all `points` (k,), with the number of rays each that `options` give, or that meets the tolerance.

    Args: corners: of the last of the points.
    """
    count = len(points) - len(corners)
    ordinary, folded = points[:count], corners.points
    most, tolerance, key = options.rays, options.tolerance, seed_key(options.seed)
    at_corners = None
    if tolerance is None or not len(points):
        samples = rays_per_corner_sample(most, False)
        later = samples * (len(folded) + len(_calibration_subset(len(folded))))
        estimated = traced_twice(tracer, ordinary, most, key, later)
        estimated_corners = traced_twice(tracer, folded, samples, key) if len(corners) else None
        tracer.scene.embree.cache_clear()  # type: ignore[attr-defined]  # who needs it afterwards builds it anew
        baked = estimated(neighbours_of(np.arange(count)) if options.denoise else None)
        at_corners = estimated_corners(None) if estimated_corners else None
    elif count:
        baked = estimate_to(tracer, ordinary, neighbours_of(np.arange(count)), tolerance, most, key)
        if len(corners):
            at_corners = traced_twice(tracer, folded, rays_per_corner_sample(baked.mean_samples, True), key)(None)
    else:  # rays can be planned by corner samples alone, of which the mean of some 18 is asked for
        alone = Neighbours.of(np.zeros((0, 3), np.int64), folded.normals, tracer.threads)
        at_corners = estimate_to(tracer, folded, alone, min(2 * tolerance, 1.0), most, key)
        baked = Estimate(np.zeros((0, 4)), np.zeros(0), at_corners.samples)
    if at_corners is None:
        return baked
    means = corners.mean(at_corners.values[:, :1]), corners.mean_direction(at_corners.values[:, 1:])
    values = np.concatenate([baked.values, np.column_stack(means)])
    variance = np.append(baked.variance, corners.variance(at_corners.variance))
    return baked._replace(values=values, variance=variance)


def estimate_outside(
    tracer: Tracer, points: Points, corners: CornerSamples, neighbours_of: NeighboursOf, inside: Bools, options: Options
) -> tuple[Estimate, int]:
    """`estimate` where points `inside` (k,) are filled from the nearest points outside; and how many were not traced.

    Points from which no path of edges leads out are traced.
    """
    if not inside.any():
        return estimate(tracer, points, corners, neighbours_of, options), 0
    neighbours = neighbours_of(np.arange(len(points)))
    nearest = nearest_baked(neighbours, ~inside)
    nearest[nearest < 0] = np.flatnonzero(nearest < 0)
    cells = Cells.of(nearest)
    kept = cells.centres
    traced = points[kept]
    graph = cells.joined(neighbours, traced.normals)
    subset = corners.only(kept)
    baked = estimate(tracer, traced, subset, lambda point_rows: neighbours_of(kept[point_rows]), options)
    known = np.column_stack([baked.values, baked.variance])
    if options.tolerance is not None:  # an error at the edge of the hidden points stands for many
        edge = np.zeros(len(kept), np.bool_)
        edge[np.diff(cells.starts) > 1] = True
        edge[graph.indices[np.repeat(edge, np.diff(graph.starts))]] = True
        edge[subset.point_rows] = False
        key = derive(seed_key(options.seed), 6)
        enough = max(2 * baked.mean_samples, rays_alone(options.tolerance))
        again = traced_twice(tracer, traced[edge], min(enough, options.rays), key)(None)
        known[edge] = np.column_stack([again.values, again.variance])
    extended = extrapolate(points, cells, graph, known)
    return baked._replace(values=extended[:, :4], variance=extended[:, 4]), len(points) - len(kept)
