"""`ao.bake`: a mesh in, w(p) for every vertex out."""

import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from raytrace.errors import ConflictError
from raytrace.mesh.mesh import Mesh, mesh_of
from raytrace.mesh.opacity import opacity_bytes
from raytrace.system.checks import check_memory

from .declared import call_checked, with_option_parameters
from .estimate.estimate import edges_of, estimate_outside
from .estimate.inside import inside_solids
from .estimate.tolerance import Estimate, shortfalls
from .interpolation_error import measure_interpolation
from .memory import TRACED, column_bytes, surface_bytes, vertex_bytes
from .options import DEFAULT_SAMPLES, Options, VertexOptions
from .points.occluders import occluding
from .points.receivers import Flag
from .prepared import Inputs, Prepared
from .result import Bake, Interpolation, PointValues, assemble, baked_vertices

_LARGE = 1 << 14  # vertices of a mesh that is not kept until somebody asks for the error between them


@dataclass(frozen=True, eq=False, repr=False)
class VertexArguments(VertexOptions, Inputs):
    """Arguments of `ao.bake`."""


@with_option_parameters(VertexArguments)
def bake(mesh: Mesh | Any, options: VertexArguments) -> Bake:
    """Obscurance w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) at every vertex, or face, of `mesh`.

    Raises:
        OptionError: an argument is out of range, or of the other method.
        MeshError: `mesh` or `high` is none, `normals="file"` for a mesh without normals, or nothing of `high` is
            within the cage.
        MemoryLimitError: the bake would not fit into memory.
        EmbreeError: Embree failed, out of memory for instance.

    Warns:
        ToleranceWarning: the `tolerance` is not met, with too few `samples` allowed for instance.
    """
    # What is given: the mesh, what occludes it, and whether it fits into memory.
    high, only = options.high, options.only
    if high is not None and (options.method == "surface" or only is not None):
        raise ConflictError("high", "does not go with", "only" if only is not None else ("method", "surface"))
    if high is not None and options.at == "faces":
        raise ConflictError("high", "does not go with", ("at", "faces"))
    mesh = mesh_of(mesh, "bake")
    occluders = occluding(options.occluders, high)
    solid = mesh if high is None else mesh_of(high, "bake")
    if options.thickness:
        solid = solid.reversed()
    _check_memory(len(mesh.vertices), [mesh, *occluders] if high is None else [solid, mesh], options)

    start = time.perf_counter()
    # Estimates of w, where and by the method asked for.
    at_vertices = high is None and options.at == "vertices"
    checkpoint = options.checkpoint if at_vertices else None
    prepared = Prepared.of(solid, options, options.progress, checkpoint, occluders, mesh.radius)
    elements = None
    if options.at == "faces":
        from .methods.face_values import sample_faces

        elements, values = sample_faces(prepared, len(mesh.faces), options.checkpoint)
    elif at_vertices and options.method == "vertex":
        values = _sample_vertices(prepared)
    elif at_vertices:
        from .methods.surface_method import fit_to_surface  # its sparse matrices load for a fifth of a second

        values = fit_to_surface(prepared)
    else:
        from .methods.fine_mesh import sample_fine_mesh

        prepared, values = sample_fine_mesh(prepared, mesh, options)
    # The bake, and later the error between its vertices, of large meshes at once.
    build = prepared.receivers.tree_seconds
    baked = assemble(prepared, mesh, elements or baked_vertices(prepared, len(mesh.vertices)), values)
    samples = values.samples
    del values  # as large as `baked`
    if at_vertices and (only is None or options.denoise):
        measure = partial(_measure_between, prepared, baked)
        if len(mesh.vertices) >= _LARGE:
            between = measure()
            measure = partial(_measured_before, between)
        baked = replace(baked, measure_between=measure)
    baked.seconds.update(build=build, bake=time.perf_counter() - start - build)
    vertices = prepared.placement.vertices
    element = "face" if options.at == "faces" else "vertex"
    if options.both_sides:
        below = call_checked(bake, options, mesh.reversed(), both_sides=False, checkpoint=None)
        baked.seconds["bake"] += sum(below.seconds.values())
        baked = replace(baked, below=below, rays=baked.rays + below.rays)
    return replace(baked, shortfalls=shortfalls(options, max(baked.rmses), samples, element, solid, vertices))


def _measure_between(prepared: Prepared, baked: Bake) -> Interpolation:
    """The error of w between the vertices. Args: baked: w at vertices of the mesh that was given."""
    between = measure_interpolation(prepared, baked.w, baked.error)
    if prepared.options.thickness:
        return between._replace(weights=between.weights[:, ::-1])
    return between


def _measured_before(between: Interpolation) -> Interpolation:
    """`Bake.measure_between` of a large mesh, whose error was measured with the bake."""
    return between


def _sample_vertices(prepared: Prepared) -> PointValues:
    """Estimate w by Monte Carlo integration at every requested point; vertices inside solids are flagged in place."""
    options, receivers = prepared.options, prepared.requested_receivers
    points, point, total = receivers.points, receivers.of_vertex, len(prepared.receivers.points)
    needed = TRACED * len(points) + column_bytes(len(points), options.columns)
    check_memory(prepared.mesh.source, needed, f"to trace rays at {len(points):,} points")
    tracer = prepared.tracer(total)
    if options.tolerance is None and options.rays >= tracer.embree_below:
        tracer.embree_below = 0  # Embree's hierarchy is not worth building for corner samples alone
    inside = inside_solids(
        points, lambda: receivers.first_vertex, prepared.placement, receivers, options.interior, tracer.threads, total
    )
    if inside.any():
        receivers.flags[np.append(inside, False)[point]] |= np.uint8(Flag.HIDDEN)  # −1, for no point, is the last row
    filled = inside & (options.interior != "mark")
    edges = edges_of(points, point, receivers.faces, tracer)

    def estimated() -> tuple[Estimate, int]:
        return estimate_outside(tracer, points, receivers.corners, edges, filled, prepared.options)

    return PointValues.of(tracer.each_column(estimated), tracer.rays, receivers.displaced)


def _check_memory(count: int, meshes: list[Mesh], options: Options) -> None:
    """Check that a bake of `count` vertices among these meshes fits into memory. Raises: MemoryLimitError."""
    vertices = sum(len(mesh.vertices) for mesh in meshes)
    faces = sum(len(mesh.faces) for mesh in meshes)
    images = opacity_bytes([mesh.opacity for mesh in meshes if mesh.opacity])
    source, work = meshes[0].source, f"to bake {count:,} vertices and {faces:,} faces"
    columns_size = column_bytes(count, options.columns)
    if options.method == "vertex":
        check_memory(source, images + columns_size + vertex_bytes(vertices, faces, options.rays), work)
        return
    instead = {"the vertex method": vertex_bytes(vertices, faces, DEFAULT_SAMPLES)}
    check_memory(source, images + surface_bytes(vertices, faces), work + " by the surface method", instead)
