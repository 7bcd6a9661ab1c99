"""`ao.bake`: a mesh in, w(p) for every vertex out."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from raytrace.errors import ConflictError
from raytrace.kernel.notice import compiling
from raytrace.mesh.convert import mesh_of
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.opacity import opacity_bytes
from raytrace.system.memory import check_memory
from raytrace.types import Bools

from .estimate.tolerance import shortfall
from .execute.checkpoint import Checkpoint
from .execute.tracer import Progress
from .falloff import Length, resolve_length
from .interpolation_error import measure_interpolation
from .memory import column_bytes, surface_bytes, vertex_bytes
from .options import (
    DEFAULT_SAMPLES,
    Falloffs,
    Interior,
    Method,
    Normals,
    Options,
    Traversal,
    earlier_names,
    falloffs_of,
)
from .points.occluders import occluding
from .prepared import Prepared
from .result import Bake, PointValues, assemble
from .vertex_method import sample_vertices


@earlier_names(reconstruct="denoise", hidden="interior")
@compiling()
def bake(
    mesh: Mesh | Any,
    falloff: Falloffs = None,
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    normals: Normals = "angle",
    progress: Progress | None = None,
    only: Bools | None = None,
    tolerance: float | None = None,
    denoise: bool = True,
    interior: Interior = "auto",
    traversal: Traversal = "auto",
    checkpoint: Checkpoint | None = None,
    method: Method = "vertex",
    high: Mesh | Any | None = None,
    cage: Length = "2%",
    profile: bool = False,
    occluders: Sequence[Mesh | Any] = (),
) -> Bake:
    """Obscurance w(p) = (1/π) ∫ μ(d) cosθ dω (12.71) at every vertex of `mesh`.

    Args:
        mesh: the surface, a `raytrace.Mesh`, a pair (vertices, faces), a mesh of trimesh, PyVista, meshio or Open3D, or
            what `ao.prepare` returns; both sides of every face occlude.
        falloff: μ, `Exponential(…)` (the default), `Binary(…)`, `Linear(…)`, `Smooth(…)` or `Tabulated(…)`; or "binary"
            or "exponential"; or a list of them, for `Bake.values` by each from the same rays, which are as long as the
            farthest needs. Vertex method only.
        samples: rays a vertex, 1 to 2²⁰, by default 256; with a tolerance the most, by default 2¹⁴. By the surface
            method they are spread over the faces by area, up to 32 from each of many points, and without this number
            there are at least 2²⁰ in all; with a tolerance, the most is 2²⁶ in all if that is more.
        seed: 0 to 2⁶⁴ − 1. The same seed gives the same bits for any number of threads.
        threads: None for all cores.
        normals: hemisphere axes: incident faces weighted by "angle", "area" or "equal", or "file", the mesh's own.
        progress: called with (rays traced, rays in all) as the work goes on.
        only: bool (n,), the vertices whose w is wanted; elsewhere w is 1. None: all. Turns denoising off;
            hidden vertices are filled from wanted ones. The surface method fits w over their faces alone.
        tolerance: target root mean square error of w, 1e-5 to 1: ray counts and baked vertices are chosen to meet it,
            the other vertices are predicted from their neighbours. None: every vertex gets `samples` rays. By the
            surface method it is the error of the fitted values.
        denoise: whether estimates are shrunk towards leave-one-out predictions from their neighbours. Vertex method
            only.
        interior: "auto": vertices inside a closed part of the mesh that is not their own are flagged, and get the
            values of the nearest that are not. "ignore": both sides of faces are surface. "mark": faces bound solids,
            and vertices that mostly see backs, being inside one, are flagged. "fill": besides, they are filled. Vertex
            method only.
        traversal: "auto": the rays of a vertex walk a hierarchy of our own together, but go through Embree in packets
            where half of them meet something and they are few; "embree": always, as a check. Vertex method only.
        checkpoint: keeps what is traced, and is asked for what an interrupted run traced; the bits are the same.
        method: "vertex" estimates w at each vertex; "surface" fits the values whose interpolation is nearest to w all
            over the faces (Kavan, Bargteil & Sloan 2011, Least Squares Vertex Baking).
        high: a finer mesh, of which w is baked instead: where it lies outwards or inwards of the vertices along the
            smooth normals of `mesh`, which itself occludes nothing. The hemisphere is that of the fine mesh there, less
            what lies below its face; estimates are denoised, and predicted, over the edges of `mesh`. Vertex method
            only, and all vertices.
        cage: how far from `mesh` the finer one may be: a length, or "2%" of the radius. Vertices at which there is
            nothing within that take the closest point, and are flagged.
        profile: also estimate w at half-distances an octave apart, from .5 % to 256 % of the radius, by the same rays:
            `Bake.profile`. Vertex method only, and without `max_distance`.
        occluders: meshes that only occlude: w is what it would be if they were part of `mesh`. Per cent are of the
            radius of `mesh` alone.

    Raises:
        OptionError: an argument is out of range, or of the other method.
        InputError, OutputError: `checkpoint` cannot be used (`Checkpoint`).
        MeshError: `mesh` or `high` is none, `normals="file"` for a mesh without normals, or nothing of `high` is
            within the cage.
        MemoryLimitError: the bake would not fit into memory.
        EmbreeError: Embree failed, out of memory for instance.

    Warns:
        ToleranceWarning: the `tolerance` is not met, with too few `samples` allowed for instance.
    """
    options = Options(
        method, falloffs_of(falloff), samples, seed, threads, normals, only, tolerance, denoise, interior, traversal,
        profile,
    )  # fmt: skip
    if high is not None and (method == "surface" or only is not None):
        raise ConflictError("high", "does not go with", "only" if only is not None else ("method", "surface"))
    mesh, others = mesh_of(mesh, "bake"), occluding(occluders, high)
    solid = mesh if high is None else mesh_of(high, "bake")
    reach = resolve_length("cage", cage, mesh.radius or 1.0)
    _check_memory(len(mesh.vertices), [mesh, *others] if high is None else [solid, mesh], options)

    start = time.perf_counter()
    prepared = Prepared.of(solid, options, progress, checkpoint if high is None else None, others)
    if high is None:
        values = _values(prepared)
    else:
        from .fine_mesh import sample_fine_mesh

        prepared, values = sample_fine_mesh(prepared, solid, mesh, reach, checkpoint)
    build = prepared.receivers.tree_seconds
    baked = assemble(replace(prepared, mesh=mesh), values, {})
    if high is None and only is None:
        baked = replace(baked, interpolation=measure_interpolation(prepared, baked.w, baked.error))
    baked.seconds.update(build=build, bake=time.perf_counter() - start - build)
    short = shortfall(options, max(baked.rmses), values.samples, "vertex")
    return replace(baked, shortfalls=(short,)) if short else baked


def _values(prepared: Prepared) -> PointValues:
    if prepared.options.method == "vertex":
        return sample_vertices(prepared)
    from .surface_method import fit_to_surface  # its sparse matrices load for a fifth of a second

    return fit_to_surface(prepared)


def _check_memory(count: int, meshes: list[Mesh], options: Options) -> None:
    """Raises: MemoryLimitError: the bake of `count` vertices among these meshes would not fit into memory."""
    vertices, faces = (sum(len(getattr(mesh, name)) for mesh in meshes) for name in ("vertices", "faces"))
    images = opacity_bytes([mesh.opacity for mesh in meshes if mesh.opacity])
    source, work = meshes[0].source, f"to bake {count:,} vertices and {faces:,} faces"
    more = column_bytes(count, options.columns)
    if options.method == "vertex":
        check_memory(source, images + more + vertex_bytes(vertices, faces, options.rays), work)
        return
    instead = {"the vertex method": vertex_bytes(vertices, faces, DEFAULT_SAMPLES)}
    check_memory(source, images + surface_bytes(vertices, faces), work + " by the surface method", instead)
