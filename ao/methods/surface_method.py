"""The surface method: values at the vertices whose interpolation is nearest to w all over the faces.

Kavan, Bargteil & Sloan 2011, Least Squares Vertex Baking.
"""

from collections.abc import Callable

import numpy as np

from obscurance.raytrace.types import Bools, Float64s

from ..least_squares.face_moments import BELOW_FACE, TRACED
from ..least_squares.fit import Fit, build_problems, fit_values
from ..least_squares.patch import Gathered, Patch, gather_moments
from ..points.receivers import Flag
from ..prepared import Prepared
from ..result import PointValues, rms

_FIRST, _LEAST = 64, 1 << 20  # rays a vertex and in all, at least, to learn how many a tolerance needs
_AIM = 0.8  # of the tolerance
_MARGIN = 20.0  # of its square, times one by the number of values: few may seem to err by too little, by chance


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
    fit, gathered = _fit(prepared, rays)
    counts = gathered.counts.sum(axis=0)
    while tolerance is not None and rays < most:
        wanted = receivers.of_vertex[requested.first_vertex]
        rmse = max(rms(error, fit.in_sight[wanted]) for error in fit.error[wanted].T[: len(options.falloffs)])
        if rmse**2 * (1 + _MARGIN / max(vertices, 1)) <= tolerance**2:
            break
        rays = min(int(rays * np.clip((rmse / (_AIM * tolerance)) ** 2, 2.0, 16.0)), most)
        fit, gathered = _fit(prepared, rays)
        counts += gathered.counts.sum(axis=0)
    if options.interior in ("mark", "fill"):
        hidden = np.append(gathered.hidden[: len(receivers.points)], False)[receivers.of_vertex]
        requested.flags[hidden & _requested(prepared)] |= np.uint8(Flag.HIDDEN)
    # The values at the points asked for.
    unknowns = receivers.of_vertex[requested.first_vertex]
    return PointValues(
        w=fit.w[unknowns, 0],
        error=fit.error[unknowns, 0],
        bent=fit.bent[unknowns],
        samples=rays // max(vertices, 1),
        rays=int(counts[TRACED]),
        rays_skipped={"below_face": int(counts[BELOW_FACE])},
        others=(fit.w[unknowns, 1:], fit.error[unknowns, 1:]) if fit.w.shape[1] > 1 else (),
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


def _fit(prepared: Prepared, rays: int) -> tuple[Fit, Gathered]:
    """A fit from so many `rays`, and what they found; arrays that are used up are freed before it."""
    receivers = prepared.receivers
    checkpoint = prepared.checkpoint
    patch = Patch.of(prepared.placement, receivers, _requested(prepared))
    gathered = gather_moments(prepared, patch, rays)
    receivers.hierarchy.release()
    if prepared.progress:
        prepared.progress(0, 1, "fit")
    problems, trial = build_problems(patch, gathered.moments, prepared.threads)
    gathered = gathered._replace(moments=gathered.moments[:0])
    del patch

    def cached(name: str, compute: Callable[[], Float64s]) -> Float64s:
        """`Kept.cached`, by a name that tells fits of other numbers of rays apart."""
        return checkpoint.cached(f"{name}, {rays} rays", compute)

    fit = fit_values(problems, trial, cached)
    fit.in_sight[gathered.buried] = 0.0  # they have values, but their errors show nowhere
    return fit, gathered
