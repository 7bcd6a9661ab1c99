"""`ao.bake_texture`: a mesh with texture coordinates in, w of every texel out."""

import time
from dataclasses import dataclass
from functools import cache, partial
from typing import Annotated, Any

import numpy as np

from raytrace.errors import OptionError
from raytrace.mesh.mesh import Mesh, mesh_of
from raytrace.mesh.opacity import opacity_bytes
from raytrace.system.checks import check_memory
from raytrace.types import Int64s

from ..declared import Option, taking
from ..estimate.estimate import estimate
from ..estimate.tolerance import Estimate, shortfalls
from ..memory import column_bytes, texture_bytes
from ..options import TextureOptions
from ..points.corners import CornerSamples
from ..points.occluders import occluding
from ..prepared import Inputs, Prepared
from ..result import of_columns
from .adjacency import texel_neighbours
from .coverage import Page
from .gathering import begin_tracing
from .projection import cage_of
from .result import BakedTexture, TextureFacts, assemble_pages
from .shown import Shown, tangent_frames
from .texels import Texels, find_texels, points_elsewhere
from .uv_layout import corner_uv, on_page, page_size


# fmt: off
@dataclass(frozen=True, eq=False, repr=False)
class _Layout(Inputs):
    uv: Annotated[Any, Option(on="", role="input", help=
        "Texture coordinates, v upwards: (n, 2) by vertex or (m, 3, 2) by face and corner. Faces for which they are "
        "NaN are not on the page, such as faces of another material; they occlude.")]
    size: Annotated[int | tuple[int, int], Option(on="", help=
        "Texels across and down, one number for a square; 1 to 16384.")] = 1024
# fmt: on


@dataclass(frozen=True, eq=False, repr=False)
class TextureArguments(TextureOptions, _Layout):
    """Arguments of `ao.bake_texture`."""


@taking(TextureArguments)
def bake_texture(mesh: Mesh | Any, options: TextureArguments) -> BakedTexture:
    """Obscurance w, as `ao.bake` has it, of every texel that shows a part of `mesh`: the mean over that part.

    The hemisphere at a point of a face is that of the normal interpolated between the vertices, less what lies below
    the face. Points of a texel that are inside solids are left out of it.

    Raises:
        OptionError: an argument is out of range.
        MeshError: `mesh`, `uv` or `high` cannot be used, or nothing of `high` is within the cage.
        InputError, OutputError, MemoryLimitError, EmbreeError: as `ao.bake`.

    Warns:
        ToleranceWarning: the `tolerance` is not met.
    """
    width, height = page_size(options.size)
    high = options.high
    mesh, walls = mesh_of(mesh, "bake_texture"), occluding(options.occluders, high)
    corners = corner_uv(options.uv, mesh)
    solid = mesh if high is None else mesh_of(high, "high")
    uv = corners
    if options.thickness:
        solid = solid.reversed()
        mesh, corners = (solid, corners[:, ::-1]) if high is None else (mesh, corners)
    cage = None if high is None else cage_of(options.cage, mesh)
    vertices, faces = (sum(len(getattr(each, name)) for each in (solid, *walls)) for name in ("vertices", "faces"))
    needed = texture_bytes(width * height, vertices, faces, options.rays)
    needed += column_bytes(width * height, options.columns)
    needed += opacity_bytes([each.opacity for each in (solid, *walls) if each.opacity])
    check_memory(mesh.source, needed, f"to bake {width * height:,} texels of {faces:,} faces")

    start = time.perf_counter()
    prepared = Prepared.of(solid, options, options.progress, None, walls, mesh.radius)
    on_pages = corners
    if walls:
        mesh, nowhere = prepared.mesh, np.full((faces - len(corners), 3, 2), np.nan)
        on_pages = np.append(corners, nowhere, axis=0)
    shown = Shown.of(mesh, on_pages, prepared, (width, height), options.wrap)
    sheet = Page.of(shown.layout, shown.areas)
    page = sheet.cover(options.overlap, prepared.threads)
    overlapping = int(np.count_nonzero(page.overlapping))
    if options.overlap == "refuse" and overlapping:
        expected = "faces that do not overlap on the page"
        raise OptionError("overlap", expected, f"{overlapping:,} texels with several", mesh.source)
    reached, coverage, missed = len(page.texels), page, np.zeros(0, np.int64)
    if cage is not None:
        coverage, missed = shown.project(page, prepared, cage, options.groups)
    texels, filled = find_texels(coverage, page, prepared, options.interior)
    del coverage, page

    def elsewhere(rows: Int64s) -> Texels:
        found = sheet.cover_again(np.sort(texels.texels[rows]), options.overlap, prepared.threads)
        if cage is not None:
            found, _ = shown.project(found, prepared, cage, options.groups)
        return points_elsewhere(texels, rows, found, prepared, options.interior)

    tracer = begin_tracing(prepared, texels, "texture", options.checkpoint, elsewhere)

    neighbours = cache(lambda: texel_neighbours(shown, texels, prepared.placement.diagonal, prepared.threads))

    def by_falloff() -> Estimate:
        return estimate(tracer, texels.first_points, CornerSamples.none(), lambda _: neighbours(), prepared.options)

    estimated, *others = tracer.each_column(by_falloff)
    neighbours.cache_clear()
    frames = None if options.bent_space == "world" else tangent_frames(shown, texels)
    if frames is not None and options.bent_space == "tangent-directx":
        frames[:, 1] *= -1
    pages_of = partial(assemble_pages, shown.layout, texels, shown.seams, options.close_seams, prepared.threads)
    (w, error, bent_normals, covered), jumps = pages_of(estimated.rows, estimated.variance, frames)
    more = [pages_of(each.rows, each.variance)[0][:2] for each in others]
    rmses = tuple(float(np.sqrt(np.mean(each.variance))) for each in (estimated, *others))
    build, layout = prepared.receivers.tree_seconds, shown.layout
    mirrored = layout.mirrored
    if options.thickness and high is None:
        mirrored = int(np.count_nonzero(on_page(corners))) - layout.flat - mirrored
    return BakedTexture(
        w=w,
        error=error,
        bent_normals=bent_normals,
        covered=covered,
        rays=tracer.rays,
        rays_skipped=estimated.skipped(filled),
        rmse=rmses[0],
        rmses=rmses,
        facts=TextureFacts(
            reached, overlapping, filled, len(missed), mirrored, layout.flat, layout.outside, shown.seams.edges, *jumps
        ),
        uv=uv,
        seconds={"build": build, "bake": time.perf_counter() - start - build},
        mu=prepared.mu,
        calibration=estimated.calibration,
        **of_columns(prepared, [np.stack(each, axis=-1) for each in zip(*more, strict=True)]),
        shortfalls=shortfalls(options, max(rmses), estimated.samples, "texel", solid, prepared.placement.vertices),
    )  # fmt: skip
