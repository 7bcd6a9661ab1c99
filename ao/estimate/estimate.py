"""The one way from sites to their values: vertices, texels, faces, points of a cloud or of a fine mesh alike.

Sites are traced, and those inside solids get the values of the nearest sites outside.
"""

import numpy as np

from obscurance.raytrace.sampling import derive, seed_key
from obscurance.raytrace.types import Bools

from ..execute.tracer import Tracer
from ..options import Options
from .cells import Cells, nearest_baked
from .ray_plan import rays_alone
from .rounds import Estimate, by_rays, to_tolerance
from .sites import Sites
from .upsampling import extrapolate


def estimate(tracer: Tracer, sites: Sites, options: Options) -> list[Estimate]:
    """Estimates of all `sites` (k,) by each falloff, with the number of rays that `options` give, or that meets the
    tolerance."""
    most, tolerance, key = options.rays, options.tolerance, seed_key(options.seed)
    if not len(sites):
        return [Estimate(np.zeros(0), np.zeros((0, 3)), np.zeros(0), most)] * tracer.columns
    if tolerance is None:
        rounds, rays = by_rays(tracer, sites, most, options.denoise, key)
    else:
        asked = len(options.falloffs)
        rounds, rays = to_tolerance(tracer, sites, tolerance, most, options.denoise, key, asked)
    tracer.scene.hierarchy.release()
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
    known = [np.column_stack([baked.w, baked.bent, baked.variance]) for baked in estimates]
    edge = np.diff(cells.starts) > 1
    if options.tolerance is not None and edge.any():  # an error at the edge of the hidden sites stands for many
        edge[graph.indices[np.repeat(edge, np.diff(graph.starts))]] = True
        enough = min(max(2 * estimates[0].mean_samples, rays_alone(options.tolerance)), options.rays)
        rounds, rays = by_rays(
            tracer, traced.only(np.flatnonzero(edge)), enough, False, derive(seed_key(options.seed), 6)
        )
        for values, again in zip(known, rounds, strict=True):
            found = again.estimate(rays)
            values[edge] = np.column_stack([found.w, found.bent, found.variance])
    extended = [extrapolate(sites.points, cells, graph, values) for values in known]
    filled = [
        baked._replace(w=values[:, 0], bent=values[:, 1:4], variance=values[:, 4])
        for baked, values in zip(estimates, extended, strict=True)
    ]
    return filled, len(sites) - len(kept)
