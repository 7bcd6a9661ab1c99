"""High to low at vertices: w of a fine mesh, where the vertices of a coarse one lie along their normals."""

from dataclasses import replace

import numpy as np

from raytrace.mesh.mesh import Mesh
from raytrace.mesh.placement import Placement
from raytrace.types import Bools, Int64s

from .estimate.estimate import edges_of, estimate_outside
from .estimate.inside import inside_solids
from .estimate.tolerance import Estimate
from .points.corners import CornerSamples
from .points.receivers import Flag, Receivers, find_receivers
from .prepared import Inputs, Prepared
from .result import PointValues
from .texture.coverage import Coverage
from .texture.gathering import begin_tracing
from .texture.projection import cage_of, project
from .texture.texels import find_texels

_OWN_CORNERS = Flag.FOLDED | Flag.OPPOSED | Flag.CONTACT  # how the coarse mesh's faces lie matters to its own w alone


def sample_fine_mesh(prepared: Prepared, high: Mesh, coarse: Mesh, inputs: Inputs) -> tuple[Prepared, PointValues]:
    """Estimate w of `high`, the mesh of `prepared`, at the vertices of `coarse`, which become the wanted points.

    Raises: MeshError: nothing is within the cage around `coarse`, or it is one of another mesh.
    """
    options, placement, fine, threads = prepared.options, prepared.placement, prepared.receivers, prepared.threads
    shown = find_receivers(coarse, Placement.of(coarse), options.normals)
    count = len(shown.points)
    nowhere = np.zeros((count, 1), np.int32), np.zeros((count, 1, 3), np.float32), np.zeros(count, np.bool_)
    coverage = Coverage.of_points(np.arange(count), *nowhere)
    positions = (coarse.vertices[shown.first_vertex] - placement.centre) * placement.scale
    axes = shown.points.normals.astype(np.float64)
    cage = cage_of(options.cage, coarse)
    reach = cage.vertices[shown.first_vertex] if isinstance(cage, Mesh) else cage
    groups = inputs.groups and (np.asarray(inputs.groups[0])[shown.first_vertex], inputs.groups[1])
    coverage, missed = project(coverage, positions, axes, prepared, reach, groups)
    texels, _ = find_texels(coverage, coverage, prepared, "ignore")
    own = fine.faces[texels.face, 0]
    inside = inside_solids(texels.points, own, placement, fine, options.interior, threads)
    row_of = np.full(count + 1, -1)
    row_of[texels.texels] = np.arange(count)
    wanted = _flagged(shown, missed, texels.texels[inside])
    tracer = begin_tracing(prepared, texels, "high to low", inputs.checkpoint)

    points = texels.first_points
    edges = edges_of(points, row_of[shown.of_vertex[shown.faces]], tracer)
    filled = inside & (options.interior != "mark")
    order = row_of[:-1]

    def estimated() -> tuple[Estimate, int]:
        found, untraced = estimate_outside(tracer, points, CornerSamples.none(), edges, filled, prepared.target)
        return replace(found, rows=found.rows[order], variance=found.variance[order]), untraced

    values = PointValues.of(tracer.each_column(estimated), tracer.rays)
    return replace(prepared, wanted=wanted), values


def _flagged(shown: Receivers, missed: Int64s, hidden: Int64s) -> Receivers:
    """The receivers of a coarse mesh with flags for points that the cage misses and that are inside of solids."""
    flags = shown.flags & ~np.uint8(_OWN_CORNERS)
    for rows, flag in ((missed, Flag.MISSED), (hidden, Flag.HIDDEN)):
        which: Bools = np.zeros(len(shown.points) + 1, np.bool_)
        which[rows] = True
        flags[which[shown.of_vertex]] |= np.uint8(flag)
    return replace(shown, flags=flags)
