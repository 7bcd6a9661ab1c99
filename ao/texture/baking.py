"""`ao.bake_texture`: a mesh with texture coordinates in, w of every texel out."""

from __future__ import annotations

import time
import warnings
from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np

from raytrace.errors import OptionError
from raytrace.kernel.notice import KERNELS_OF_TEXTURE, compiling
from raytrace.mesh.convert import mesh_of
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.normals import face_normals
from raytrace.mesh.opacity import opacity_bytes
from raytrace.mesh.placement import Placement
from raytrace.system.memory import check_memory
from raytrace.types import Int64s

from ..estimate.estimate import estimate
from ..estimate.one_ring import Neighbours
from ..estimate.tolerance import ToleranceWarning
from ..execute.checkpoint import Checkpoint
from ..execute.tracer import Progress
from ..falloff import Falloff, Length, resolve_length
from ..memory import texture_bytes
from ..options import Hidden, Normals, Options, Traversal, falloff_of
from ..points.corners import Corners
from ..points.receivers import find_receivers
from ..prepared import Prepared
from .adjacency import face_charts, texel_neighbours, texel_sizes
from .coverage import Overlap, cover
from .gathering import begin_tracing
from .projection import Fine, project
from .result import BakedTexture, TextureFacts, assemble_pages
from .seams import Seams
from .surface_points import Faces
from .tangents import tangent_frames
from .texels import find_texels
from .uv_layout import UVLayout, corner_uv, on_page, page_size

BentSpace = Literal["world", "tangent"]


@compiling(KERNELS_OF_TEXTURE)
def bake_texture(
    mesh: Mesh | Any,
    uv: Any,
    size: int | tuple[int, int] = 1024,
    falloff: Falloff | str | None = None,
    samples: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    normals: Normals = "angle",
    progress: Progress | None = None,
    tolerance: float | None = None,
    reconstruct: bool = True,
    hidden: Hidden = "auto",
    traversal: Traversal = "auto",
    checkpoint: Checkpoint | None = None,
    overlap: Overlap = "mean",
    wrap: bool = True,
    close_seams: bool = True,
    bent_space: BentSpace = "world",
    high: Mesh | Any | None = None,
    cage: Length = "2%",
) -> BakedTexture:
    """Obscurance w, as `ao.bake` has it, of every texel that shows a part of `mesh`: the mean over that part.

    The hemisphere at a point of a face is that of the normal interpolated between the vertices, less what lies below
    the face. Where points of a texel are inside of solids, the others stand for it.

    Args:
        mesh, falloff, seed, threads, normals, progress, traversal, checkpoint: as `ao.bake` has them.
        uv: texture coordinates, v upwards: (n, 2) by vertex or (m, 3, 2) by face and corner. Faces for which they are
            NaN are not on the page, as those of another material; they occlude.
        size: texels across and down, one number for a square; 1 to 16384.
        samples: rays a texel, 1 to 2²⁰, by default 256; with a tolerance the most, by default 2¹⁴.
        tolerance: target root mean square error of w over the covered texels, 1e-5 to 1.
        reconstruct: whether estimates are shrunk towards predictions from the texels next to them on the surface,
            across seams too.
        hidden: "auto": texels inside a closed part of the mesh that is not their own are filled as if they were not
            covered; "fill": also those that mostly see backs of faces; "ignore": none.
        overlap: where faces lie over one another on the page: "mean", the texel is that of all of them; "first", of
            the first in the mesh's order; "refuse", an error.
        wrap: whether faces outside of the unit square are taken modulo 1, or left out.
        close_seams: whether texels at charts' borders are moved until both sides of a seam agree.
        bent_space: of bent normals: "world", the mesh's own, or "tangent": x along u, y along v upwards, z the normal.
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
        "vertex", falloff_of(falloff), samples, seed, threads, normals, None, tolerance, reconstruct, hidden, traversal
    )
    if hidden == "mark":
        raise OptionError("hidden", "auto, ignore or fill for a texture", "mark")
    if overlap not in get_args(Overlap):
        raise OptionError("overlap", "one of " + ", ".join(get_args(Overlap)), overlap)
    if bent_space not in get_args(BentSpace):
        raise OptionError("bent_space", "one of " + ", ".join(get_args(BentSpace)), bent_space)
    width, height = page_size(size)
    mesh = mesh_of(mesh, "bake_texture")
    corners = corner_uv(uv, mesh)
    solid = mesh if high is None else mesh_of(high, "high")
    reach = resolve_length("cage", cage, mesh.radius or 1.0)
    mu = options.falloff.resolve(solid.radius)
    counts = len(solid.vertices), len(solid.faces)
    needed = texture_bytes(width * height, *counts, options.rays)
    needed += opacity_bytes([solid.opacity]) if solid.opacity else 0
    check_memory(mesh.source, needed, f"to bake {width * height:,} texels of {counts[1]:,} faces")

    start = time.perf_counter()
    prepared = Prepared.of(solid, mu, options, progress, None)
    placement, receivers, count = prepared.placement, prepared.receivers, prepared.threads
    shown = receivers
    vertices = placement.vertices.astype(np.float64)
    if high is not None:
        shown = find_receivers(mesh, Placement.of(mesh), normals)
        vertices = (mesh.vertices - solid.centre) * placement.scale
    has_area = face_normals(Placement.of(mesh).vertices.astype(np.float64), mesh.faces)[1] > 0
    layout = UVLayout.of(corners[has_area], (width, height), wrap, mesh.source)
    coverage = cover(layout, overlap, count)
    overlapping = int(np.count_nonzero(coverage.overlapping))
    if overlap == "refuse" and overlapping:
        expected = "faces that do not overlap on the page"
        raise OptionError("overlap", expected, f"{overlapping:,} texels with several", mesh.source)
    covered, page, missed = len(coverage.texels), coverage, np.zeros(0, np.int64)
    if high is not None:
        fine = Fine(placement.vertices.astype(np.float64), receivers, solid.source)
        flat, weights = coverage.face.ravel().astype(np.int64), coverage.barycentric.reshape(-1, 3)
        places, _, axes = Faces.of(vertices, shown).points_at(flat, weights, count)
        coverage, missed = project(coverage, places, axes, fine, reach * placement.scale, count)
    texels, filled = find_texels(coverage, page, placement, receivers, options, count)
    del coverage, page
    points_of_faces = np.where(on_page(corners[has_area])[:, None], shown.of_vertex[shown.faces], -1)
    seams = Seams.find(layout.uv, points_of_faces, (width, height), wrap)
    tracer = begin_tracing(prepared, texels, "texture", checkpoint)
    points = texels.first_points

    def neighbours(_: Int64s) -> Neighbours:
        charts = face_charts(layout.uv, points_of_faces)
        sizes = texel_sizes(layout.uv, vertices, shown.faces, placement.diagonal)
        return texel_neighbours(texels, points, layout, seams, charts, sizes, count)

    found = estimate(tracer, points, Corners.none(), neighbours, prepared.target)
    frames = None
    if bent_space == "tangent":
        on_faces = Faces.of(vertices, shown)
        frames = tangent_frames(layout.uv, shown.faces, points_of_faces, on_faces, texels.shown, texels.shown_at)
    pages = assemble_pages(layout, texels, found.rows, found.variance, frames, seams, close_seams, count)
    build = receivers.tree_seconds
    baked = BakedTexture(
        w=pages.w,
        error=pages.error,
        bent_normals=pages.bent_normals,
        covered=pages.covered,
        rays=tracer.rays,
        rays_skipped=found.skipped(filled),
        rmse=float(np.sqrt(np.mean(found.variance))),
        facts=TextureFacts(
            covered, overlapping, filled, len(missed), layout.mirrored, layout.flat, layout.outside, seams.edges,
            pages.jump, pages.jump_before,
        ),
        uv=corners,
        seconds={"build": build, "bake": time.perf_counter() - start - build},
        mu=mu,
        calibration=found.calibration,
    )  # fmt: skip
    if tolerance is not None and baked.rmse > tolerance:
        reason = f": {options.rays:,} rays a texel were allowed" if found.samples >= options.rays else ""
        text = f"tolerance {tolerance:g} is not met, the estimated RMSE is {baked.rmse:.3g}{reason}"
        warnings.warn(text, ToleranceWarning, stacklevel=2)
        return replace(baked, shortfalls=(text,))
    return baked
