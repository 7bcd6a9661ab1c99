"""Estimates at the points of a surface: the tracer for them, and as many rays as are given or a tolerance needs."""

from __future__ import annotations

import hashlib

from ..adaptive.fixed_samples import estimated, traced_twice
from ..adaptive.tolerance import Estimate, estimate_to
from ..denoise.one_ring import Neighbours
from ..gather.points import Points
from ..prepared import Prepared
from ..trace.checkpoint import Checkpoint
from ..trace.traversal import packets_below
from .texels import Texels, TexelTracer


def begin_tracing(prepared: Prepared, texels: Texels, kind: str, checkpoint: Checkpoint | None) -> TexelTracer:
    """A tracer of `texels` on the mesh of `prepared`, and the checkpoint begun. Args: kind: of bake."""
    options, receivers, placement = prepared.options, prepared.receivers, prepared.placement
    if checkpoint:
        digest = hashlib.blake2b(texels.points.origins.data)
        digest.update(texels.points.normals.data)
        settings = (
            options.traversal,
            options.rays,
            options.tolerance,
            options.reconstruct,
            options.seed,
            options.normals,
        )
        checkpoint.begin(placement, receivers, prepared.mu, kind, *settings, digest.hexdigest())
    return TexelTracer(
        prepared.scene,
        packets_below(options.traversal, receivers.tree, placement, receivers.points, prepared.mu),
        placement,
        prepared.mu,
        prepared.threads,
        total_points=len(texels.points),
        progress=prepared.progress,
        checkpoint=checkpoint,
        texels=texels,
    )


def estimate(tracer: TexelTracer, points: Points, neighbours: Neighbours | None, prepared: Prepared) -> Estimate:
    """Estimates at `points`, with a number of rays each that is given or meets the tolerance."""
    options = prepared.options
    if options.tolerance is None:
        traced = traced_twice(tracer, points, options.rays, prepared.key)
        tracer.all_traced()
        return estimated(traced, points, neighbours)
    assert neighbours is not None  # `Options` has seen to it
    return estimate_to(tracer, points, neighbours, options.tolerance, options.rays, prepared.key)
