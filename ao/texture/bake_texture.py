"""`ao.bake_texture`: a mesh with texture coordinates in, w of every texel out."""

import time
from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np

from obscurance.raytrace.errors import OptionError
from obscurance.raytrace.mesh.corners import with_hard_edges
from obscurance.raytrace.mesh.mesh import Mesh, mesh_of
from obscurance.raytrace.sampling import derive
from obscurance.raytrace.system.checks import NEGLIGIBLE, check_memory
from obscurance.raytrace.types import Float64s, Int64s

from ..declared import Option, known_names, options_record
from ..estimate.estimate import estimate
from ..estimate.sites import Sites
from ..execute.kept import Kept
from ..execute.sample_means import SampleMeans
from ..execute.tracer import Progress
from ..falloff import Falloffs, Length
from ..memory import TRACED_TEXEL, bytes_of_texture
from ..options import BackFaces, BentSpace, Interior, Normals, Overlap, TextureOptions, Weight
from ..points.occluders import occluding
from ..points.projection import cage_of
from ..prepared import Inputs, Prepared
from ..result import of_columns, shortfalls
from .adjacency import texel_neighbours
from .coverage import Page
from .result import BakedTexture, PageAssembly, TextureFacts
from .tangents import tangent_frames
from .texels import Cage, Texels, TexelSampler
from .uv_layout import UVLayout, corner_uv, covered_texels, on_page, page_size
from .uv_surface import UVSurface

_PLACES = 11  # salt of the key of places in texels


@options_record
class _Layout(Inputs):
    uv: Any
    size: Annotated[int | tuple[int, int], Option(bake_kinds="")] = 1024


@options_record
class TextureArguments(TextureOptions, _Layout):
    """Arguments of `ao.bake_texture`."""


@known_names
def bake_texture(
    mesh: Mesh | Any,
    uv: Any,
    size: int | tuple[int, int] = 1024,
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
    overlap: Overlap = "mean",
    wrap: bool = True,
    close_seams: bool = True,
    bent_space: BentSpace = "world",
) -> BakedTexture:
    """Obscurance w, as `ao.bake` has it, of every texel that shows a part of `mesh`: the mean over that part.

    The hemisphere at a point of a face is about the normal interpolated between the face's corners, each side of a hard
    edge by its own, less what lies below the face. Points of a texel that are inside solids are left out of the mean.

    Args:
        mesh: The surface, a `raytrace.Mesh`, a pair (vertices, faces), a mesh of trimesh, PyVista, meshio or Open3D, or
            what `ao.prepare` returns.
        uv: Texture coordinates, v upwards: (n, 2) by vertex or (m, 3, 2) by face and corner. Faces for which they are
            NaN are not on the page, such as faces of another material; they occlude.
        size: Texels across and down, one number for a square; 1 to 16384.
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
        overlap: Texture: where faces overlap, w is their mean (the default within a material), the first's, or an
            error.
        wrap: whether faces outside of the unit square are taken modulo 1, or left out.
        close_seams: whether texels at charts' borders are moved until both sides of a seam agree.
        bent_space: Of bent normals: the mesh's own (the default), or tangent: +Y, or with -directx -Y. "tangent": x
            along u, y along v upwards, as OpenGL and glTF have it, z the normal; "tangent-directx": with y downwards.

    Raises:
        OptionError: an argument is out of range.
        MeshError: `mesh`, `uv` or `high` cannot be used, or nothing of `high` is within the cage.
        InputError, OutputError, MemoryLimitError, EmbreeError: as `ao.bake`.

    Warns:
        ToleranceWarning: the `tolerance` is not met.
    """
    return bake_page(TextureArguments(**locals()))


def bake_page(options: TextureArguments) -> BakedTexture:
    """`bake_texture`, of arguments that are checked."""
    size = page_size(options.size)
    scene = _scene(mesh_of(options.mesh, "bake_texture"), options)
    _check_memory(scene, size, options)

    # The mesh on the page, and the texels that its faces cover.
    start = time.perf_counter()
    shaded = scene.solid if options.normals == "up" else with_hard_edges(scene.solid, options.normals == "file")
    prepared = Prepared.of(shaded, options, options.progress, None, scene.occluders, scene.mesh.radius)
    watch = prepared.progress or _unwatched
    watch(0, 1, "coverage")
    surface = _surface(scene, prepared, size, options.wrap)
    page = Page.of(surface.layout, surface.areas, surface.charts)
    sampler = TexelSampler(page, surface, prepared, options, scene.cage)
    coverage = sampler.page.cover(options.overlap, prepared.threads, key=derive(prepared.key, _PLACES))
    reached = len(coverage.texels)
    overlapping = int(np.count_nonzero(coverage.overlapping))
    if options.overlap == "refuse" and overlapping:
        expected = "faces that do not overlap on the page"
        raise OptionError("overlap", expected, f"{overlapping:,} texels with several", scene.mesh.source)
    # The samples of the texels, and rays from them.
    texels, filled, missed = sampler.find(coverage)
    shown = surface.shown_near_seams(coverage, prepared.threads) if options.close_seams else None
    del coverage
    needed = TRACED_TEXEL * len(texels.samples)
    if needed > NEGLIGIBLE:
        check_memory(scene.mesh.source, needed, f"to trace rays at {len(texels.samples):,} texels")
    watch(1, 1, "coverage")
    tracer = prepared.sample_tracer(
        SampleMeans(texels.samples, partial(sampler.elsewhere, texels)), "texture", options.checkpoint
    )
    beside = partial(texel_neighbours, surface, texels, prepared.placement.diagonal, prepared.threads)
    estimates = estimate(tracer, Sites(texels.points, beside, texels.kinds, texels.stands_for), options)
    # The pages, seams closed and the rest filled.
    watch(0, 1, "seams")
    assembly = PageAssembly(surface.layout, texels, surface.seams, shown, prepared.threads)
    pages = assembly.assemble(estimates[0], _frames(options.bent_space, surface, texels))
    further_pages = [assembly.assemble(estimate)[:2] for estimate in estimates[1:]]
    watch(1, 1, "seams")
    rmses = tuple(float(np.sqrt(np.mean(estimate.variance))) for estimate in estimates)
    return BakedTexture(
        w=pages.w,
        error=pages.error,
        bent_normals=pages.bent_normals,
        covered=pages.covered,
        rays=tracer.rays,
        rays_skipped=estimates[0].skipped(filled),
        rmse=rmses[0],
        rmses=rmses,
        facts=TextureFacts(
            covered=reached,
            overlapping=overlapping,
            hidden=filled,
            missed=missed,
            mirrored=_mirrored(scene, surface.layout),
            flat=surface.layout.flat,
            outside=surface.layout.outside,
            seam_edges=surface.seams.edges,
            seam_jump=pages.jump,
            seam_jump_before=pages.jump_before,
        ),
        uv=scene.uv,
        seconds=_seconds(start, prepared),
        mu=prepared.mu,
        mesh=scene.mesh,
        calibration=estimates[0].calibration,
        **of_columns(options, prepared.mus, [np.stack(pages, axis=-1) for pages in zip(*further_pages, strict=True)]),
        shortfalls=shortfalls(options, rmses, estimates[0].samples, "texel", scene.solid, prepared.placement.vertices),
    )


def _unwatched(done: int, total: int, stage: str) -> None:
    """A progress callback that does nothing."""


class _Scene(NamedTuple):
    """What a texture shows, and what is baked."""

    mesh: Mesh  # on the page
    uv: Float64s  # (m, 3, 2), of its faces
    solid: Mesh  # what is baked: the mesh itself, or a fine mesh; reversed for thickness
    cage: Cage | None  # about the mesh, if there is a fine mesh
    occluders: list[Mesh]


def _scene(mesh: Mesh, options: TextureArguments) -> _Scene:
    """The meshes of a bake, checked. Raises: MeshError, OptionError, ConflictError."""
    occluders = occluding(options.occluders, options.high)
    uv = corner_uv(options.uv, mesh)
    solid = mesh if options.high is None else mesh_of(options.high, "high")
    cage = None if options.high is None else Cage(cage_of(options.cage, mesh, solid), options.groups)
    return _Scene(mesh, uv, solid.reversed() if options.thickness else solid, cage, occluders)


def _check_memory(scene: _Scene, size: tuple[int, int], options: TextureArguments) -> None:
    """Check that the bake of a page of `size` fits into memory. Raises: MemoryLimitError."""
    texels = size[0] * size[1]
    solids = [scene.solid, *scene.occluders]
    blocks = options.tolerance is not None and options.denoise and options.high is None
    needed = bytes_of_texture(solids, options, texels, covered_texels(scene.uv, size), blocks)
    faces = sum(len(solid.faces) for solid in solids)
    check_memory(scene.mesh.source, needed, f"to bake {texels:,} texels of {faces:,} faces")


def _surface(scene: _Scene, prepared: Prepared, size: tuple[int, int], wrap: bool) -> UVSurface:
    """The mesh on the page; behind its faces are listed faces that only occlude, which are not on the page."""
    if scene.cage:
        return UVSurface.of(scene.mesh, scene.uv, prepared, size, wrap)
    uv = scene.uv if scene.solid is scene.mesh else scene.uv[:, ::-1]  # reversed
    nowhere = np.full((len(prepared.mesh.faces) - len(uv), 3, 2), np.nan)
    return UVSurface.of(prepared.mesh, np.append(uv, nowhere, axis=0), prepared, size, wrap)


def _mirrored(scene: _Scene, layout: UVLayout) -> int:
    """How many faces of the mesh are turned over on the page."""
    if scene.cage or scene.solid is scene.mesh:
        return layout.mirrored
    return int(np.count_nonzero(on_page(scene.uv))) - layout.flat - layout.mirrored


def _frames(space: BentSpace, surface: UVSurface, texels: Texels) -> Float64s | None:
    """The frames (k, 3, 3) of bent normals in a space; None: the mesh's own."""
    if space == "world":
        return None
    frames = tangent_frames(surface, texels)
    if space == "tangent-directx":
        frames[:, 1] *= -1
    return frames


def _seconds(start: float, prepared: Prepared) -> dict[str, float]:
    """Seconds of each stage of a bake that began at `start`."""
    build = prepared.receivers.tree_seconds
    return {"build": build, "bake": time.perf_counter() - start - build}
