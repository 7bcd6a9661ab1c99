"""The vertex method: w by Monte Carlo integration over the hemisphere of each vertex."""

import numpy as np

from raytrace.system.memory import NEGLIGIBLE, check_memory

from .estimate.estimate import edges_of, estimate_outside
from .estimate.inside import inside_solids
from .estimate.tolerance import Estimate
from .memory import column_bytes, point_bytes
from .points.receivers import Flag
from .prepared import Prepared
from .result import PointValues


def sample_vertices(prepared: Prepared) -> PointValues:
    """Estimate w at every point that is wanted; vertices inside solids are flagged in place."""
    options, receivers = prepared.options, prepared.wanted
    points, point, total = receivers.points, receivers.of_vertex, len(prepared.receivers.points)
    needed = point_bytes(len(points)) + column_bytes(len(points), options.columns)
    if needed > NEGLIGIBLE:
        check_memory(prepared.mesh.source, needed, f"to trace rays at {len(points):,} points")
    tracer = prepared.tracer(total)
    inside = inside_solids(
        points, receivers.first_vertex, prepared.placement, receivers, options.interior, tracer.threads, total
    )
    baked = point >= 0
    receivers.flags[baked & np.append(inside, False)[point]] |= np.uint8(Flag.HIDDEN)
    filled = inside & (options.interior != "mark")
    edges = edges_of(points, point[receivers.faces], tracer)

    def estimated() -> tuple[Estimate, int]:
        return estimate_outside(tracer, points, receivers.corners, edges, filled, prepared.target)

    return PointValues.of(tracer.each_column(estimated), tracer.rays, receivers.displaced)
