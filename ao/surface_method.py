"""The surface method: values at the vertices whose interpolation is nearest to w all over the faces.

Kavan, Bargteil & Sloan 2011, Least Squares Vertex Baking.
"""

from __future__ import annotations

import numpy as np

from .least_squares.face_moments import BELOW, TRACED
from .least_squares.fit import build_problems, fit_values
from .least_squares.patch import Patch, gather_moments, reveal_interiors
from .prepared import Prepared
from .result import PointValues


def fit_to_surface(prepared: Prepared) -> PointValues:
    """Fit w over the faces of every point that is wanted; Embree's scene is released, to make room for the fit."""
    receivers, wanted, only = prepared.receivers, prepared.wanted, prepared.options.only
    patch = Patch.of(prepared.placement, receivers, np.ones(len(wanted.flags), np.bool_) if only is None else only)
    moments, counts = gather_moments(prepared, patch)
    reveal_interiors(patch, moments, counts)
    traced = counts.sum(axis=0)
    receivers.embree().release()
    problem, trial = build_problems(patch, moments, prepared.threads)
    del patch, moments, counts
    checkpoint = prepared.checkpoint
    fit = fit_values(problem, trial, checkpoint.once if checkpoint else lambda _, compute: compute())
    rows = receivers.of_vertex[wanted.first_vertex]
    return PointValues(
        w=fit.w[rows],
        error=fit.error[rows],
        bent=fit.bent[rows],
        samples=prepared.options.rays,
        rays=int(traced[TRACED]),
        rays_skipped={"below_face": int(traced[BELOW])},
    )
