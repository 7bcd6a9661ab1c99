"""The surface method: values at the vertices whose interpolation is nearest to w all over the faces.

Kavan, Bargteil & Sloan 2011, Least Squares Vertex Baking.
"""

from collections.abc import Callable

import numpy as np

from obscurance.raytrace.types import Bools, Float64s, Int64s

from ..least_squares.face_moments import BELOW, TRACED
from ..least_squares.fit import Fit, build_problems, fit_values
from ..least_squares.patch import Patch, gather_moments
from ..prepared import Prepared
from ..result import PointValues, rms

_FIRST, _LEAST = 64, 1 << 20  # rays a vertex and in all, at least, to learn how many a tolerance needs
_AIM = 0.8  # of the tolerance


def fit_to_surface(prepared: Prepared) -> PointValues:
    """Fit w over the faces of every point that is requested: once, or from ever more rays until a tolerance is met."""
    receivers = prepared.receivers
    requested = prepared.requested_receivers
    options = prepared.options
    tolerance = options.tolerance
    vertices = _unknowns(prepared)
    # Few rays at first, where a tolerance says how many are enough.
    rays = most = options.rays_in_all(vertices)
    if tolerance is not None:
        rays = min(max(_FIRST * vertices, _LEAST), most)
    fit, counts = _fit(prepared, rays)
    while tolerance is not None and rays < most:
        wanted = receivers.of_vertex[requested.first_vertex]
        rmse = rms(fit.error[wanted], fit.in_sight[wanted])
        if rmse <= tolerance:
            break
        rays = min(int(rays * np.clip((rmse / (_AIM * tolerance)) ** 2, 2.0, 16.0)), most)
        fit, fit_counts = _fit(prepared, rays)
        counts += fit_counts
    # The values at the points asked for.
    unknowns = receivers.of_vertex[requested.first_vertex]
    return PointValues(
        w=fit.w[unknowns],
        error=fit.error[unknowns],
        bent=fit.bent[unknowns],
        samples=rays // max(vertices, 1),
        rays=int(counts[TRACED]),
        rays_skipped={"below_face": int(counts[BELOW])},
        in_sight=fit.in_sight[unknowns],
    )


def _requested(prepared: Prepared) -> Bools:
    """Which vertices (n,) are to get w."""
    if prepared.requested is not None:
        return prepared.requested
    return np.ones(len(prepared.requested_receivers.flags), np.bool_)


def _unknowns(prepared: Prepared) -> int:
    """How many values a fit has: points and vertices without one, of all faces that have a wanted vertex."""
    receivers = prepared.receivers
    faces = receivers.faces[_requested(prepared)[receivers.faces].any(axis=1)]
    points = receivers.of_vertex[faces]
    return len(np.unique(points[points >= 0])) + len(np.unique(faces[points < 0]))


def _fit(prepared: Prepared, rays: int) -> tuple[Fit, Int64s]:
    """A fit from so many `rays`, and counts (3,), see `gather_faces`; arrays that are used up are freed before it."""
    receivers = prepared.receivers
    checkpoint = prepared.checkpoint
    patch = Patch.of(prepared.placement, receivers, _requested(prepared))
    moments, counts = gather_moments(prepared, patch, rays)
    totals = counts.sum(axis=0)
    if prepared.options.tolerance is None:
        receivers.embree().release()
        receivers.embree.cache_clear()  # type: ignore[attr-defined]  # who needs it afterwards builds it anew
    if prepared.progress:
        prepared.progress(0, 1, "fit")
    problem, trial = build_problems(patch, moments, prepared.threads)
    del patch, moments, counts

    def cached(name: str, compute: Callable[[], Float64s]) -> Float64s:
        """As `Kept.cached`, by a name that tells fits of other numbers of rays apart."""
        return checkpoint.cached(f"{name}, {rays} rays", compute)

    return fit_values(problem, trial, cached), totals
