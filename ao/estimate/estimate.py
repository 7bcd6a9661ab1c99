"""The one way from sites to their values: vertices, texels, faces, points of a cloud or of a fine mesh alike.

Sites are traced, and those inside solids get the values of the nearest sites outside.
"""

import numpy as np

from obscurance.raytrace.sampling import derive, seed_key
from obscurance.raytrace.system.parallel import each
from obscurance.raytrace.types import Bools, Int32Rows, Int32s, Int64Rows, Int64s

from ..execute.tracer import Tracer
from ..options import Options
from ..points.points import Points
from .cells import Cells, nearest_baked
from .one_ring import Neighbours
from .ray_plan import rays_alone
from .rounds import Estimate, by_rays, to_tolerance
from .sites import Sites
from .upsampling import extrapolate


def edges_of(points: Points, of_vertex: Int64s, faces: Int64s, threads: int) -> Neighbours:
    """Neighbours along the edges of `faces` (m, 3).

    Args: of_vertex: (n,), the row in `points` of each vertex, −1 for none.
    """
    corners = np.empty(faces.shape, np.int32)
    _look_up.on(threads)(of_vertex.astype(np.int32), faces, corners)
    return Neighbours.of(corners, points.normals, threads)


@each("faces")
def _look_up(f: int, row_of_vertex: Int32s, faces: Int64Rows, corners: Int32Rows) -> None:
    for k in range(3):
        corners[f, k] = row_of_vertex[faces[f, k]]


def estimate(tracer: Tracer, sites: Sites, options: Options) -> list[Estimate]:
    """Estimates of all `sites` (k,) by each falloff, with the number of rays that `options` give, or that meets the
    tolerance."""
    most, tolerance, key = options.rays, options.tolerance, seed_key(options.seed)
    if not len(sites):
        return [Estimate(np.zeros((0, 4)), np.zeros(0), most)] * tracer.columns
    if tolerance is None:
        rounds, rays = by_rays(tracer, sites, most, options.denoise, key)
    else:
        asked = len(options.falloffs)
        rounds, rays = to_tolerance(tracer, sites, tolerance, most, options.denoise, key, asked)
    return [round_.estimate(rays) for round_ in rounds]


def estimate_outside(tracer: Tracer, sites: Sites, inside: Bools, options: Options) -> tuple[list[Estimate], int]:
    """`estimate` where sites `inside` (k,) are filled from the nearest ones outside; and how many were not traced.

    Sites from which no path of edges leads out are traced.
    """
    if not inside.any():
        return estimate(tracer, sites, options), 0
    nearest = nearest_baked(sites.neighbours, ~inside)
    nearest[nearest < 0] = np.flatnonzero(nearest < 0)
    cells = Cells.of(nearest)
    kept = cells.centres
    traced = sites.only(kept)
    graph = cells.joined(sites.neighbours, traced.points.normals)
    estimates = estimate(tracer, traced, options)
    known = [np.column_stack([baked.values, baked.variance]) for baked in estimates]
    if options.tolerance is not None:  # an error at the edge of the hidden sites stands for many
        edge = np.zeros(len(kept), np.bool_)
        edge[np.diff(cells.starts) > 1] = True
        edge[graph.indices[np.repeat(edge, np.diff(graph.starts))]] = True
        enough = min(max(2 * estimates[0].mean_samples, rays_alone(options.tolerance)), options.rays)
        rounds, rays = by_rays(
            tracer, traced.only(np.flatnonzero(edge)), enough, False, derive(seed_key(options.seed), 6)
        )
        for values, again in zip(known, rounds, strict=True):
            found = again.estimate(rays)
            values[edge] = np.column_stack([found.values, found.variance])
    extended = [extrapolate(sites.points, cells, graph, values) for values in known]
    filled = [
        baked._replace(values=values[:, :4], variance=values[:, 4])
        for baked, values in zip(estimates, extended, strict=True)
    ]
    return filled, len(sites) - len(kept)
