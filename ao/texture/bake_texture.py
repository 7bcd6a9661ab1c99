"""`ao.bake_texture`: a mesh with texture coordinates in, w of every texel out."""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, Literal, get_args

import numpy as np

from raytrace.errors import ConflictError, OptionError
from raytrace.kernel.notice import compiling
from raytrace.mesh.convert import mesh_of
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.opacity import opacity_bytes
from raytrace.system.memory import check_memory

from ..estimate.estimate import estimate
from ..estimate.one_ring import Neighbours
from ..estimate.tolerance import Estimate, shortfall
from ..execute.checkpoint import Checkpoint
from ..execute.tracer import Progress
from ..falloff import Length, resolve_length
from ..memory import column_bytes, texture_bytes
from ..options import Falloffs, Interior, Normals, Options, Traversal, earlier_names, falloffs_of
from ..points.corners import CornerSamples
from ..points.occluders import occluding
from ..prepared import Prepared
from ..result import of_columns
from .coverage import Overlap, cover
from .gathering import begin_tracing
from .result import BakedTexture, TextureFacts, assemble_pages
from .shown import Shown
from .texels import find_texels
from .uv_layout import corner_uv, page_size

BentSpace = Literal["world", "tangent", "tangent-directx"]


@earlier_names(reconstruct="denoise", hidden="interior")
@compiling()
def bake_texture(
    mesh: Mesh | Any,
    uv: Any,
    size: int | tuple[int, int] = 1024,
    falloff: Falloffs = None,
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    normals: Normals = "angle",
    progress: Progress | None = None,
    tolerance: float | None = None,
    denoise: bool = True,
    interior: Interior = "auto",
    traversal: Traversal = "auto",
    checkpoint: Checkpoint | None = None,
    overlap: Overlap = "mean",
    wrap: bool = True,
    close_seams: bool = True,
    bent_space: BentSpace = "world",
    high: Mesh | Any | None = None,
    cage: Length = "2%",
    profile: bool = False,
    occluders: Sequence[Mesh | Any] = (),
) -> BakedTexture:
    """Obscurance w, as `ao.bake` has it, of every texel that shows a part of `mesh`: the mean over that part.

    The hemisphere at a point of a face is that of the normal interpolated between the vertices, less what lies below
    the face. Points of a texel that are inside solids are left out of it.

    Args:
        mesh, falloff, seed, threads, normals, progress, traversal, checkpoint, profile, occluders: as of `ao.bake`.
        uv: texture coordinates, v upwards: (n, 2) by vertex or (m, 3, 2) by face and corner. Faces for which they are
            NaN are not on the page, such as faces of another material; they occlude.
        size: texels across and down, one number for a square; 1 to 16384.
        samples: rays a texel, 1 to 2²⁰, by default 256; with a tolerance the most, by default 2¹⁴.
        tolerance: target root mean square error of w over the covered texels, 1e-5 to 1.
        denoise: whether estimates are shrunk towards predictions from the texels next to them on the surface,
            across seams too.
        interior: "auto": texels inside a closed part of the mesh that is not their own are filled as if they were not
            covered; "fill": also texels that mostly see backs of faces; "ignore": none.
        overlap: where faces lie over one another on the page: "mean", the texel is that of all of them; "first", of
            the first in the mesh's order; "refuse", an error.
        wrap: whether faces outside of the unit square are taken modulo 1, or left out.
        close_seams: whether texels at charts' borders are moved until both sides of a seam agree.
        bent_space: of bent normals: "world", the mesh's own; "tangent": x along u, y along v upwards (+Y, as OpenGL
            and glTF have it), z the normal; or "tangent-directx": the same with y downwards (−Y).
        high: a finer mesh, of which w is baked instead: that of its points outwards or inwards of `mesh` along the
            smooth normals of that. `mesh` itself then occludes nothing.
        cage: how far from `mesh` the finer one may be: a length, or "2%" of the radius. Points at which there is
            nothing within that take the closest one, and are counted.

    Raises:
        OptionError: an argument is out of range.
        MeshError: `mesh`, `uv` or `high` cannot be used, or nothing of `high` is within the cage.
        InputError, OutputError, MemoryLimitError, EmbreeError: as `ao.bake`.

    Warns:
        ToleranceWarning: the `tolerance` is not met.
    """
    options = Options(
        "vertex", falloffs_of(falloff), samples, seed, threads, normals, None, tolerance, denoise, interior, traversal,
        profile,
    )  # fmt: skip
    _check_texture_options(interior, overlap, bent_space)
    width, height = page_size(size)
    mesh, walls = mesh_of(mesh, "bake_texture"), occluding(occluders, high)
    corners = corner_uv(uv, mesh)
    solid = mesh if high is None else mesh_of(high, "high")
    reach = resolve_length("cage", cage, mesh.radius or 1.0)
    vertices, faces = (sum(len(getattr(each, name)) for each in (solid, *walls)) for name in ("vertices", "faces"))
    needed = texture_bytes(width * height, vertices, faces, options.rays) + column_bytes(
        width * height, options.columns
    )
    needed += opacity_bytes([each.opacity for each in (solid, *walls) if each.opacity])
    check_memory(mesh.source, needed, f"to bake {width * height:,} texels of {faces:,} faces")

    start = time.perf_counter()
    prepared = Prepared.of(solid, options, progress, None, walls)
    on_pages = corners
    if walls:
        mesh, nowhere = prepared.mesh, np.full((faces - len(corners), 3, 2), np.nan)
        on_pages = np.append(corners, nowhere, axis=0)
    shown = Shown.of(mesh, on_pages, prepared, (width, height), wrap)
    page = cover(shown.layout, overlap, prepared.threads)
    overlapping = int(np.count_nonzero(page.overlapping))
    if overlap == "refuse" and overlapping:
        expected = "faces that do not overlap on the page"
        raise OptionError("overlap", expected, f"{overlapping:,} texels with several", mesh.source)
    covered, coverage, missed = len(page.texels), page, np.zeros(0, np.int64)
    if high is not None:
        coverage, missed = shown.project(page, prepared, reach)
    texels, filled = find_texels(coverage, page, prepared.placement, prepared.receivers, options, prepared.threads)
    del coverage, page
    tracer = begin_tracing(prepared, texels, "texture", checkpoint)

    @cache
    def neighbours() -> Neighbours:
        return shown.neighbours(texels, prepared.placement.diagonal, prepared.threads)

    def by_falloff() -> Estimate:
        none = CornerSamples.none()
        return estimate(tracer, texels.first_points, none, lambda _: neighbours(), prepared.target)

    estimated, *others = tracer.each_column(by_falloff)
    neighbours.cache_clear()
    frames = None if bent_space == "world" else shown.tangent_frames(texels)
    if frames is not None and bent_space == "tangent-directx":
        frames[:, 1] *= -1
    values = estimated.rows, estimated.variance, frames
    closed = shown.seams, close_seams, prepared.threads
    pages = assemble_pages(shown.layout, texels, *values, *closed)
    more = [assemble_pages(shown.layout, texels, each.rows, each.variance, None, *closed) for each in others]
    rmses = tuple(float(np.sqrt(np.mean(each.variance))) for each in (estimated, *others))
    build, layout = prepared.receivers.tree_seconds, shown.layout
    baked = BakedTexture(
        w=pages.w,
        error=pages.error,
        bent_normals=pages.bent_normals,
        covered=pages.covered,
        rays=tracer.rays,
        rays_skipped=estimated.skipped(filled),
        rmse=rmses[0],
        rmses=rmses,
        facts=TextureFacts(
            covered, overlapping, filled, len(missed), layout.mirrored, layout.flat, layout.outside, shown.seams.edges,
            pages.jump, pages.jump_before,
        ),
        uv=corners,
        seconds={"build": build, "bake": time.perf_counter() - start - build},
        mu=prepared.mu,
        calibration=estimated.calibration,
        **of_columns(prepared, [np.stack(each, axis=-1) for each in zip(*((p.w, p.error) for p in more), strict=True)]),
    )  # fmt: skip
    short = shortfall(options, max(rmses), estimated.samples, "texel")
    return replace(baked, shortfalls=(short,)) if short else baked


def _check_texture_options(interior: Interior, overlap: Overlap, bent_space: BentSpace) -> None:
    if interior == "mark":
        raise ConflictError(("interior", "mark"), "does not go with", "a texture")
    for name, value, known in (("overlap", overlap, Overlap), ("bent_space", bent_space, BentSpace)):
        if value not in get_args(known):
            raise OptionError(name, "one of " + ", ".join(get_args(known)), value)
