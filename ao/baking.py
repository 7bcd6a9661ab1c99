"""`ao.bake`: a mesh in, w(p) for every vertex out."""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from obscurance.raytrace.errors import ConflictError
from obscurance.raytrace.mesh.mesh import Mesh, mesh_of
from obscurance.raytrace.system.checks import check_memory
from obscurance.raytrace.types import Bools, Int64s

from .declared import known_names, options_record
from .estimate.estimate import estimate_outside
from .estimate.inside import inside_solids
from .estimate.one_ring import Neighbours
from .estimate.sites import FOLDED, ONE_PLACE, Sites
from .execute.kept import Kept
from .execute.tracer import Progress
from .falloff import Falloffs, Length
from .interpolation_error import measure_interpolation
from .memory import TRACED, bytes_at_vertices, column_bytes
from .options import (
    DEFAULT_SAMPLES,
    FITS_INPUT,
    At,
    BackFaces,
    Interior,
    Method,
    Normals,
    Options,
    VertexOptions,
    Weight,
)  # fmt: skip
from .points.occluders import occluding
from .points.receivers import Flag
from .prepared import Inputs, Prepared
from .result import Bake, Interpolation, PointValues, assemble, baked_vertices, shortfalls

_CORNER_SHARE = 8  # of a vertex's rays, for each of some 18 corner samples, whose mean errs as much as a vertex's w
_CORNER_SHARE_DENOISED = 3  # where other vertices are denoised
_LARGE = 1 << 14  # vertices of a mesh that is not kept until somebody asks for the error between them


@options_record
class VertexArguments(VertexOptions, Inputs):
    """Arguments of `ao.bake`."""


@known_names
def bake(
    mesh: Mesh | Any,
    falloff: Falloffs = None,
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    normals: Normals = "file",
    *,
    progress: Progress | None = None,
    checkpoint: Kept | None = None,
    high: Mesh | Any | None = None,
    groups: tuple[Int64s, Int64s] | None = None,
    occluders: Sequence[Mesh | Any] = (),
    tolerance: float | None = None,
    denoise: bool = True,
    interior: Interior = "auto",
    thickness: bool = False,
    spread: float = 180.0,
    weight: Weight = "cosine",
    back_faces: BackFaces = "occlude",
    profile: bool = False,
    cage: Length | Mesh | Any = "2%",
    only: Bools | None = None,
    method: Method = "vertex",
    at: At = "vertices",
    both_sides: bool = False,
) -> Bake:
    """Obscurance w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) at every vertex, or face, of `mesh`.

    Args:
        mesh: The surface, a `raytrace.Mesh`, a pair (vertices, faces), a mesh of trimesh, PyVista, meshio or Open3D, or
            what `ao.prepare` returns.
        falloff: μ, `Exponential(…)` (the default), `Binary(…)`, `Linear(…)`, `Smooth(…)` or `Tabulated(…)`; or "binary"
            or "exponential"; or a function of the distance in mesh units, which becomes a `Tabulated`; or a
            list of them, for `values` of the result by each from the same rays, which are as long as the farthest
            needs.
        samples: Rays per vertex or texel, in place of a tolerance; with `tolerance` the most, by default 16384. At most
            2²⁰. By the surface method they are spread over the faces by area, up to 32 from each of many points, and
            with a tolerance the most is 2²⁶ in all if that is more.
        seed: Random seed. 0 to 2⁶⁴ − 1. The same seed gives the same bits for any number of threads.
        threads: Number of threads, by default all cores; results are the same.
        normals: Normals: the file's own at corners, and where it has none of use, as with angle; those of faces around,
            weighted by angle, by area or equally, smooth across edges of up to 30 degrees; or up. They are the axes of
            hemispheres.
        progress: Called with (rays traced, rays in all, stage) as the work goes on; a stage without rays, as "coverage"
            and "seams" of a texture, counts to 1.
        checkpoint: Keeps what is traced, and is asked for what an interrupted run traced; the bits are the same.
        high: A finer mesh, of which w is baked instead: where it lies outwards or inwards along the smooth normals of
            `mesh`, which itself occludes nothing. The hemisphere is that of the fine mesh there, less what lies below
            its face; estimates are denoised, and predicted, over `mesh`. Not by the surface method, nor with `only`.
        groups: Numbers of groups of the vertices of `mesh` (n,) and of those of `high`, by which their faces are of a
            group, too: points are found on faces of their own group alone. All faces of `high` occlude.
        occluders: Meshes that only occlude: w is what it would be if they were part of `mesh`. Per cent are of the
            radius of `mesh` alone. Not with `high`.
        tolerance: Target RMS error of w, 0.005 by default; ray counts are chosen to meet it. 1e-5 to 1; over the
            vertices or the covered texels, by the surface method of the fitted values. None where `samples` alone is
            given, and without `denoise` where neither is, by 256 rays of each point.
        denoise: Shrink estimates towards those of neighbours. They are leave-one-out predictions, of texels across
            seams, too. The surface method fits instead.
        interior: Vertices inside closed solids: ignore, flag (mark), or fill from visible neighbours; auto fills those
            inside parts of the mesh that are closed. "auto": vertices inside a closed part that is not their own are
            flagged and get the values of the nearest that are not; texels are filled as if they were not covered.
            "ignore": both sides of faces are surface. "mark": faces bound solids, and vertices that mostly see backs,
            being inside one, are flagged; not of texels. "fill": besides, they are filled, and texels are. By the
            surface method samples that mostly see backs count next to nothing, but with "ignore"; vertices among such
            samples alone are flagged with "mark", and filled with "fill".
        thickness: How thick the solid is below each point instead: the same rays inwards, 0 thin, 1 thick. By the same
            falloff; where rays leave through holes of the mesh it is thick, which `shortfalls` says. Not with
            `interior` mark or fill.
        spread: Full angle in degrees of the cone of rays about the normal, in which 180, the hemisphere, is all. 1 to
            180. w is the mean over rays within it: 1 where nothing is in the cone.
        weight: Of directions: like their cosine to the normal, or uniform, so that w is a share of the solid angle.
        back_faces: ignore: rays pass through faces that they meet from behind, as through single-sided walls. A face's
            front is where its corners run anticlockwise. `interior` sees backs all the same.
        profile: Also store w at half-distances an octave apart, from .5% to 256% of the radius, so that the
            half-distance can be chosen later: .npz .ply .glb .html, textures .exr; by default in .html, if that costs
            little. In Python the result's `profile`, by the same rays, with the `max_distance` of the first falloff,
            unless this is a table.
        cage: With `high`: how far it may be from the input, mesh units or "2%" of the radius (the default); or a mesh
            file, the input with its vertices moved outwards. A mesh has as many vertices and faces as `mesh`, in its
            order: rays start at the point of the cage that belongs to a point of `mesh`, go through it and as far
            inwards. Points at which there is nothing within that take the closest one: vertices are flagged, points of
            texels counted.
        only: bool (n,), the vertices whose w is wanted; elsewhere w is 1. None: all. These are denoised, and hidden
            ones filled, from one another. The surface method fits w over their faces alone.
        method: Sample at the vertices, or all over the faces with a least-squares fit. "surface" fits the values whose
            interpolation is nearest to w all over the faces (Kavan, Bargteil & Sloan 2011, Least Squares Vertex
            Baking).
        at: faces: w of each face, its mean over the face, into .npy, .npz or .ply. Hemispheres are about the faces' own
            normals, and rows of the result are those of `mesh.faces`. Not by the surface method, nor with `high`; with
            `only`, at faces of which all vertices are wanted.
        both_sides: Also w of the backs of faces. It is that of the result's `below`.

    Raises:
        OptionError: an argument is out of range, or of the other method.
        MeshError: `mesh` or `high` is none, `normals="file"` for a mesh without normals, or nothing of `high` is
            within the cage.
        MemoryLimitError: the bake would not fit into memory.
        EmbreeError: Embree failed, out of memory for instance.

    Warns:
        ToleranceWarning: the `tolerance` is not met, with too few `samples` allowed for instance.
    """
    return bake_vertices(VertexArguments(**locals()))


def bake_vertices(options: VertexArguments) -> Bake:
    """`bake`, of arguments that are checked."""
    # What is given: the mesh, what occludes it, and whether it fits into memory.
    high, only = options.high, options.only
    if high is not None and only is not None:
        raise ConflictError("high", "does not go with", "only")
    if high is not None and options.method == "surface":
        raise ConflictError("high", "does not go with", ("method", "surface"), why=FITS_INPUT)
    if high is not None and options.at == "faces":
        raise ConflictError("high", "does not go with", ("at", "faces"), why="as w is found where vertices are")
    mesh = mesh_of(options.mesh, "bake")
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
        below = bake_vertices(replace(options, mesh=mesh.reversed(), both_sides=False, checkpoint=None))
        baked.seconds["bake"] += sum(below.seconds.values())
        baked = replace(baked, below=below, rays=baked.rays + below.rays)
    return replace(baked, shortfalls=shortfalls(options, baked.rmses, samples, element, solid, vertices))


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
    inside = inside_solids(
        points, lambda: receivers.first_vertex, prepared.placement, receivers, options.interior, tracer.threads
    )
    if inside.any():
        receivers.flags[np.append(inside, False)[point]] |= np.uint8(Flag.HIDDEN)  # −1, for no point, is the last row
    filled = np.zeros_like(inside) if options.interior == "mark" else inside
    edges = partial(Neighbours.of, receivers.faces, point, points.normals, tracer.threads)
    sites = Sites.alike(points, edges, ONE_PLACE)
    corners = receivers.corners
    if len(corners):
        from .execute.sample_means import FoldedMeans

        sites.kinds[corners.point_rows] = FOLDED
        share = _CORNER_SHARE if options.tolerance is None else _CORNER_SHARE_DENOISED
        tracer.means = FoldedMeans(corners, points.numbers[corners.point_rows], share)
    estimates, hidden = estimate_outside(tracer, sites, filled, options)
    del sites
    return PointValues.of(estimates, hidden, tracer.rays, receivers.displaced)


def _check_memory(count: int, meshes: list[Mesh], options: Options) -> None:
    """Check that a bake of `count` vertices among these meshes fits into memory. Raises: MemoryLimitError."""
    work = f"to bake {count:,} vertices and {sum(len(mesh.faces) for mesh in meshes):,} faces"
    instead = {}
    if options.method == "surface":
        work += " by the surface method"
        instead["the vertex method"] = bytes_at_vertices(meshes, Options(samples=DEFAULT_SAMPLES))
    check_memory(meshes[0].source, bytes_at_vertices(meshes, options), work, instead)
