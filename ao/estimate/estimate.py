"""The one way from points to their values: vertices, texels, points of a fine mesh alike.

Points with a hemisphere of their own are traced, folded points get the mean over their `CornerSamples`, and points
inside solids the values of the nearest points outside.
"""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from raytrace.types import Bools, Int64s

from ..execute.tracer import Tracer
from ..points.corners import CornerSamples
from ..points.points import Points
from .extrapolation import Extrapolation
from .fixed_samples import (
    count_corner_rays,
    estimated,
    rays_per_corner_sample,
    sampled,
    traced_twice,
    with_corner_means,
)
from .one_ring import Neighbours
from .probes import derive
from .tolerance import Estimate, estimate_to

NeighboursOf = Callable[[Int64s], Neighbours]
"""From rows of points (k,), ascending, their neighbours among each other, numbered in that order."""


class Target(NamedTuple):
    """What a bake asks for.

    Attributes:
        samples: rays a point; with a tolerance the most. tolerance: root mean square error of w, or None.
        denoise: whether estimates are shrunk towards predictions from neighbours. key: of the directions.
    """

    samples: int
    tolerance: float | None
    denoise: bool
    key: np.uint32


def edges_of(points: Points, faces: Int64s, tracer: Tracer) -> NeighboursOf:
    """Neighbours along the edges of `faces` (m, 3), rows of `points` or −1; kept where several falloffs need them."""
    threads, kept = tracer.threads, dict[bytes, Neighbours]()

    def among(rows: Int64s) -> Neighbours:
        if not tracer.mu.columns:
            return made(rows)
        digest = hashlib.blake2b(rows.data).digest()
        return kept.get(digest) or kept.setdefault(digest, made(rows))

    def made(rows: Int64s) -> Neighbours:
        if len(rows) == len(points):
            return Neighbours.of(faces, points.normals, threads)
        return Neighbours.of(_renumbering(rows, len(points))[faces], points.normals[rows], threads)

    return among


def estimate(
    tracer: Tracer, points: Points, corners: CornerSamples, neighbours_of: NeighboursOf, target: Target
) -> Estimate:
    """Estimates at all `points` (k,), with a number of rays each that is given or meets the tolerance."""
    rows = np.delete(np.arange(len(points)), corners.rows)
    ordinary = points[rows] if len(corners) else points
    max_samples, tolerance, denoise, key = target
    if tolerance is None or not len(points):
        samples = rays_per_corner_sample(max_samples, False)
        tracer.later = count_corner_rays(corners, samples)
        traced = traced_twice(tracer, ordinary, max_samples, key)
        tracer.later = 0
        if len(corners) and max_samples >= tracer.packets_below:
            tracer.packets_below = 0  # Embree's hierarchy is not worth building for corner samples alone
        at_corners = traced_twice(tracer, corners.points, samples, key) if len(corners) else None
        tracer.checkpoint.all_traced()
        tracer.scene.embree.cache_clear()  # type: ignore[attr-defined]  # who needs it afterwards builds it anew
        values = estimated(traced, ordinary, neighbours_of(rows) if denoise else None)
        if at_corners is None:
            return values
        return with_corner_means(values, rows, estimated(at_corners, corners.points, None), corners)
    if not len(rows):  # rays can be planned by corner samples alone, of which the mean of some 18 is asked for
        alone = Neighbours.of(np.zeros((0, 3), np.int64), corners.points.normals, tracer.threads)
        sampled_corners = estimate_to(tracer, corners.points, alone, min(2 * tolerance, 1.0), max_samples, key)
        nothing = Estimate(np.zeros((0, 4)), np.zeros(0), sampled_corners.samples, 0)
        return with_corner_means(nothing, rows, sampled_corners, corners)
    values = estimate_to(tracer, ordinary, neighbours_of(rows), tolerance, max_samples, key)
    if not len(corners):
        return values
    samples = rays_per_corner_sample(values.samples, True)
    return with_corner_means(values, rows, sampled(tracer, corners.points, samples, key), corners)


def estimate_outside(
    tracer: Tracer, points: Points, corners: CornerSamples, neighbours_of: NeighboursOf, inside: Bools, target: Target
) -> tuple[Estimate, int]:
    """`estimate` where points `inside` (k,) are filled from the nearest points outside; how many were not traced."""
    if not inside.any():
        return estimate(tracer, points, corners, neighbours_of, target), 0
    extrapolation = Extrapolation.of(points, neighbours_of(np.arange(len(points))), inside)
    kept = np.flatnonzero(extrapolation.traced)
    traced, subset = points[kept], corners.only(kept)
    values = estimate(tracer, traced, subset, lambda rows: neighbours_of(kept[rows]), target)
    known = np.column_stack([values.rows, values.variance])
    if target.tolerance is not None:  # an error at the edge of the hidden points stands for many
        edge = extrapolation.sources
        edge[subset.rows] = False
        again = sampled(tracer, traced[edge], min(4 * values.samples, target.samples), derive(target.key, 6))
        known[edge] = np.column_stack([again.rows, again.variance])
    rows = extrapolation.extrapolate(known)
    return replace(values, rows=rows[:, :4], variance=rows[:, 4]), len(points) - len(kept)


def _renumbering(rows: Int64s, count: int) -> Int64s:
    """The place of each of `count` points, and of −1, in `rows`; −1 for points that are not in them."""
    place = np.full(count + 1, -1)
    place[rows] = np.arange(len(rows))
    return place
