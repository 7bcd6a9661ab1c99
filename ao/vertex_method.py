"""The vertex method: w by Monte Carlo integration over the hemisphere of each vertex."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from raytrace.types import Bools

from .adaptive.fixed_samples import estimated, place_samples, rays_of_corners, sampled, traced_twice, with_corners
from .adaptive.probes import derive
from .adaptive.tolerance import Estimate, estimate_to
from .denoise.one_ring import Neighbours
from .gather.receivers import Flag, Receivers
from .interior.fill import Fill
from .interior.inside import any_back, hidden_points, inside_other_parts
from .prepared import Prepared
from .result import PointValues
from .trace.tracer import Tracer
from .trace.traversal import packets_below


def sample_vertices(prepared: Prepared) -> PointValues:
    """Estimate w at every point that is wanted; vertices inside solids are flagged in place."""
    options, receivers = prepared.options, prepared.wanted
    tracer = _tracer(prepared)
    point = receivers.of_vertex
    baked = point >= 0
    inside = _inside(prepared)
    if inside.any():
        receivers.flags[baked & inside[point]] |= np.uint8(Flag.HIDDEN)
    untraced = np.zeros(len(receivers.points), np.bool_)
    if inside.any() and options.hidden != "mark":
        filling = Fill.of(receivers.points, _neighbours(receivers, tracer.threads), inside)
        untraced = ~filling.traced
        traced = receivers.only(baked & ~untraced[point])
        estimate = _estimate(tracer, traced, prepared)
        known = np.column_stack([estimate.rows, estimate.variance])
        if options.tolerance is not None:  # errors at the edge of what is hidden stand for many
            edge = filling.sources
            edge[traced.corners.rows] = False
            samples = min(4 * estimate.samples, options.rays)
            again = sampled(tracer, traced.points[edge], samples, derive(prepared.key, 6))
            known[edge] = np.column_stack([again.rows, again.variance])
        rows = filling.extrapolate(known)
        estimate = replace(estimate, rows=rows[:, :4], variance=rows[:, 4])
    else:
        estimate = _estimate(tracer, receivers, prepared)
    return PointValues(
        w=np.clip(estimate.rows[:, 0], 0.0, 1.0),
        error=np.sqrt(estimate.variance + receivers.displaced**2),
        bent=estimate.rows[:, 1:],
        samples=estimate.samples,
        rays=tracer.rays,
        rays_skipped={
            "predicted": (estimate.samples - estimate.screened) * estimate.predicted,
            "hidden": estimate.samples * int(np.count_nonzero(untraced)),
        },
        calibration=estimate.calibration,
    )


def _tracer(prepared: Prepared) -> Tracer:
    receivers = prepared.receivers
    return Tracer(
        prepared.scene,
        packets_below(prepared.options.traversal, prepared.scene, prepared.placement, receivers.points, prepared.mu),
        prepared.placement,
        prepared.mu,
        prepared.threads,
        total_points=len(receivers.points),  # of the whole mesh, so that `only` changes no direction
        progress=prepared.progress,
        checkpoint=prepared.checkpoint,
    )


def _inside(prepared: Prepared) -> Bools:
    """The points (k,) that are inside a solid, as the option `hidden` defines it."""
    hidden, receivers, threads = prepared.options.hidden, prepared.wanted, prepared.threads
    vertices, reach = prepared.placement.vertices, prepared.placement.diagonal
    count, total = len(receivers.points), len(prepared.receivers.points)
    if hidden == "ignore":
        return np.zeros(count, np.bool_)
    if hidden == "auto":
        return inside_other_parts(receivers, vertices, reach, total, threads)
    solids = any_back(receivers, count)
    return hidden_points(receivers.embree(), receivers.points, solids, reach, total, threads)


def _neighbours(receivers: Receivers, threads: int) -> Neighbours:
    return Neighbours.of(receivers.of_vertex[receivers.faces], receivers.points.normals, threads)


def _estimate(tracer: Tracer, receivers: Receivers, prepared: Prepared) -> Estimate:
    """Estimates at all points of `receivers`, with a number of rays each that is given or meets the tolerance."""
    tolerance, most, key = prepared.options.tolerance, prepared.options.rays, prepared.key
    ordinary, rows = receivers.ordinary()
    corners, places = receivers.corners, receivers.corners.places
    if tolerance is None or not len(receivers.points):
        samples = place_samples(most, False)
        tracer.later = rays_of_corners(corners, samples)
        traced = traced_twice(tracer, ordinary.points, most, key)
        tracer.later = 0
        at_corners = traced_twice(tracer, places, samples, key) if len(corners) else None
        tracer.all_traced()
        denoised = prepared.options.reconstruct and prepared.options.only is None
        neighbours = _neighbours(ordinary, tracer.threads) if denoised else None
        estimate = estimated(traced, ordinary.points, neighbours)
        if at_corners is None:
            return estimate
        return with_corners(estimate, rows, estimated(at_corners, places, None), corners)
    if len(rows):
        estimate = estimate_to(tracer, ordinary.points, _neighbours(ordinary, tracer.threads), tolerance, most, key)
        samples = place_samples(estimate.samples, True)
    else:  # none to plan rays by but places, of which the mean of some 18 is asked for
        alone = Neighbours.of(np.zeros((0, 3), np.int64), places.normals, tracer.threads)
        found = estimate_to(tracer, places, alone, min(2 * tolerance, 1.0), most, key)
        nothing = Estimate(np.zeros((0, 4)), np.zeros(0), found.samples, 0)
        return with_corners(nothing, rows, found, corners)
    if not len(corners):
        return estimate
    return with_corners(estimate, rows, sampled(tracer, places, samples, key), corners)
