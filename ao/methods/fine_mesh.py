"""w of a fine mesh at the vertices of a coarse one: each is a sample where it is projected onto the fine surface."""

from dataclasses import replace
from functools import partial

import numpy as np

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.morton import morton_order
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.types import Int64s, UInt8s

from ..estimate.estimate import estimate_outside
from ..estimate.one_ring import Neighbours
from ..estimate.sites import ONE_PLACE, Sites
from ..execute.sample_means import SampleMeans
from ..points.projection import FineMesh, PlacedMesh, cage_of
from ..points.receivers import Flag, Receivers, find_receivers
from ..points.smooth_surface import PointGroups, SmoothSurface, SurfacePoints
from ..points.surface_samples import SurfaceSamples
from ..prepared import Inputs, Prepared
from ..result import PointValues

_OWN_CORNERS = Flag.FOLDED | Flag.OPPOSED | Flag.CONTACT  # how the coarse mesh's faces lie matters to its own w alone


def sample_fine_mesh(prepared: Prepared, coarse: Mesh, inputs: Inputs) -> tuple[Prepared, PointValues]:
    """Estimate w of the mesh of `prepared` at the vertices of `coarse`, which become the wanted points.

    Raises: MeshError: nothing is within the cage around `coarse`, or it is one of another mesh; or faces lack areas.
    """
    options, threads = prepared.options, prepared.threads
    # Points of the fine mesh in place of the vertices, and which of them are missed or hidden.
    vertices = find_receivers(coarse, Placement.of(coarse), options.normals)
    if not len(vertices.points):
        raise MeshError(coarse.source, "faces", "some that have an area", "none")
    projected, missed = _project(prepared, coarse, vertices, inputs)
    samples, order = _place(prepared, projected)
    inside = prepared.inside(samples)
    flags = vertices.flags & ~np.uint8(_OWN_CORNERS)
    _flag(flags, vertices, missed, Flag.MISSED)
    _flag(flags, vertices, order[inside], Flag.HIDDEN)
    tracer = prepared.sample_tracer(SampleMeans(samples), "high to low", inputs.checkpoint)

    # Edges between them as the coarse mesh has them, over which estimates are denoised.
    row_of = np.full(len(order) + 1, -1)
    row_of[order] = np.arange(len(order))
    edges = partial(Neighbours.of, vertices.faces, row_of[vertices.of_vertex], samples.points.normals, threads)
    filled = inside & (options.interior != "mark")
    sites = Sites.alike(samples.points, edges, ONE_PLACE)
    estimates, untraced = estimate_outside(tracer, sites, filled, options)
    # Values in the order of the vertices.
    sample_of = row_of[:-1]
    estimates = [
        each._replace(w=each.w[sample_of], bent=each.bent[sample_of], variance=each.variance[sample_of])
        for each in estimates
    ]
    values = PointValues.of(estimates, untraced, tracer.rays)
    return prepared._replace(requested_receivers=replace(vertices, flags=flags)), values


def _project(prepared: Prepared, coarse: Mesh, vertices: Receivers, inputs: Inputs) -> tuple[SurfacePoints, Int64s]:
    """The vertices of `coarse` on the fine mesh, and which of them the cage misses."""
    placement = prepared.placement
    fine = FineMesh(prepared.mesh.source, placement, prepared.receivers, prepared.threads, prepared.progress)
    # One vertex for each point: its place, and the cage's there.
    representative = vertices.first_vertex
    if isinstance(coarse, PlacedMesh):
        face, barycentric = coarse.places
        return SurfacePoints(face[representative], barycentric[representative]), np.zeros(0, np.int64)
    positions = (coarse.vertices[representative] - placement.centre) * placement.scale
    cage = cage_of(prepared.options.cage, coarse, prepared.mesh)
    reach = cage.vertices[representative] if isinstance(cage, Mesh) else cage
    groups = inputs.groups and (np.asarray(inputs.groups[0])[representative], inputs.groups[1])
    return fine.project(positions, vertices.points.normals.astype(np.float64), reach, groups)


def _place(prepared: Prepared, projected: SurfacePoints) -> tuple[SurfaceSamples, Int64s]:
    """Sample groups of one projected point each along a curve that keeps neighbours together, and the point (k,) of
    each group."""
    receivers, threads = prepared.receivers, prepared.threads
    surface = SmoothSurface.of(prepared.placement.vertices.astype(np.float64), receivers)
    order = morton_order(surface.positions_at(*projected, threads))
    count = len(order)
    in_order = PointGroups(np.arange(count + 1), projected.face[order], projected.barycentric[order])
    return SurfaceSamples.place(in_order, np.zeros(count, np.bool_), surface, receivers, threads), order


def _flag(flags: UInt8s, vertices: Receivers, points: Int64s, flag: Flag) -> None:
    """Set a flag of the vertices of some `points`."""
    flags[np.isin(vertices.of_vertex, points)] |= np.uint8(flag)
