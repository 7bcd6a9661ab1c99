"""A bake to vertices: from the meshes of a plan to w in a file, a report and an image of the flagged vertices."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from obscurance import ao
from obscurance.ao.baking import VertexArguments, bake_vertices
from obscurance.ao.estimate.calibration import Calibration
from obscurance.ao.options import VertexOptions
from obscurance.ao.result import VISIBLE, of_columns
from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.raytrace.system.checks import check_outputs
from obscurance.raytrace.types import AnyFloats, Bools, Float64s, Int64s

from ..formats.table import is_raster
from ..formats.unsupported import unsupported_features
from ..formats.write import write_vertices
from ..show.progress import progress
from ..show.report.verdict import COARSE
from .console import HARD, bake_summary, warn
from .record import Record
from .report import OutputSummary, WorkSize, command_again, hashed_inputs, write_bake_report

if TYPE_CHECKING:
    from obscurance.ao.execute.kept import Kept
    from obscurance.ao.execute.tracer import Progress
    from obscurance.raytrace.mesh.mesh import Mesh

    from ..asset.asset import Asset
    from ..show.report.pictures import Picture
    from .inputs import BakeInputs
    from .plan import OpenCheckpoint, Plan


def work_size(plan: Plan, inputs: BakeInputs) -> WorkSize:
    """The size of the bake."""
    from obscurance.ao.memory import bytes_at_vertices
    from obscurance.raytrace.mesh.normals import face_areas

    chosen = inputs.chosen
    used = np.zeros(len(chosen.mesh.vertices), np.bool_)
    used[chosen.mesh.faces[face_areas(chosen.mesh.vertices, chosen.mesh.faces) > 0]] = True
    points = int(np.count_nonzero(used if chosen.only is None else used & chosen.only))
    if inputs.source.cloud:
        points = len(inputs.source.cloud[0])
    return WorkSize(points, "vertices", bytes_at_vertices(inputs.solids, plan.arguments, points))


def run(plan: Plan, inputs: BakeInputs, open_checkpoint: OpenCheckpoint) -> Iterator[OutputSummary]:
    """Bake to the vertices, and write the file, its report and its image. Raises: as `ao.bake` and writers."""
    options = plan.options
    check_outputs(plan.outputs, inputs.files)
    loaded = time.perf_counter()
    hashes = hashed_inputs(plan, inputs) if options.report else []
    losses = [*unsupported_features(plan.output, inputs.source, plan.channels), *_hard_edges(plan, inputs)]
    warnings = warn(inputs.meshes, [*inputs.notes, *losses], plan.falloff, inputs.source.cloud is not None)
    with open_checkpoint(plan.output) as checkpoint:
        baked = trace(plan, inputs, checkpoint)
        # Warnings about the result, before it is written.
        coarse = _coarse(plan, inputs.source, baked)
        lines = [*coarse, *baked.shortfalls]
        missed = baked.flagged["missed"]
        if missed:
            outside = "outside the cage of the fine mesh; they take its closest point"
            lines.append(f"{plan.output}: {missed:,} of {len(baked.w):,} vertices lie {outside}")
        warnings = [*warn([], lines), *warnings]
        traced = time.perf_counter()
        channels = plan.channels._replace(record=Record.of(plan, inputs.source.mesh).text)
        if plan.ending == ".html":
            channels = channels._replace(again=command_again(plan, inputs.source), warning="".join(coarse))
        with progress(options.quiet, "writing", form=options.progress):
            write_vertices(plan.output, baked, inputs.source, channels)
    seconds = {"load": loaded - inputs.started, "write": time.perf_counter() - traced}
    if options.report:
        from obscurance.ao.report import report

        def pictures() -> list[list[Picture]]:
            from ..show.report.pictures import pictures_of_faces, pictures_of_vertices

            if baked.at == "faces":
                return [pictures_of_faces(baked.mesh, baked.w, baked.error)]
            return [pictures_of_vertices(inputs.source.baked_mesh(len(baked.w)), baked.w, baked.error)]

        write_bake_report(plan, report(baked, plan.described(), seconds, warnings), hashes, pictures)
    if options.debug_image:
        from ..show.report.pictures import write_marked

        write_marked(options.debug_image, inputs.source.baked_mesh(len(baked.w)), baked)
    yield OutputSummary(bake_summary(baked, plan.output) + inputs.refined + inputs.alpha, warnings)


def _hard_edges(plan: Plan, inputs: BakeInputs) -> list[str]:
    """A line about vertices on hard edges, which have one value, in a file that is looked at; nothing without any."""
    mesh = inputs.chosen.mesh
    one_each = plan.ending in (".ply", ".obj", ".vtp", ".glb") and plan.options.at == "vertices"
    if not one_each or plan.arguments.normals == "up" or plan.options.high or inputs.source.cloud:
        return []
    from obscurance.raytrace.mesh.corners import on_hard_edges

    count = len(on_hard_edges(mesh))
    sides = "one value stands for all sides; textures have one for each"
    return [f"{plan.output}: {count:,} of {len(mesh.vertices):,} {HARD}: {sides}"] if count else []


def _coarse(plan: Plan, source: Asset, baked: ao.Bake) -> list[str]:
    """A line about values that are wrong between the vertices, and what makes them right in this output; none for
    cells of a raster, which have nothing between them."""
    if not baked.coarse or baked.interpolation is None or is_raster(plan.output):
        return []
    text = f"{plan.output}: {COARSE} {baked.interpolation.rmse:.2f}, as the faces are too large for it"
    uv = None
    with suppress(MeshError):  # malformed coordinates, of which nothing else here makes use
        uv = source.uv
    texture = "--occlusion texture" if uv is not None else "--occlusion texture --uv unwrap"
    if plan.ending == ".glb" and not plan.channels.colors and not is_raster(plan.mesh):
        return [f"{text}: add {texture}"]
    if baked.interpolation.best <= VISIBLE and _can_be_fitted(plan):
        return [f"{text}: add --method surface"]
    if plan.ending in (".npy", ".npz") or is_raster(plan.mesh):
        return [f"{text}: subdivide them"]
    cut = "add --between 0.02" if plan.ending == ".ply" and plan.options.method == "vertex" else "subdivide them"
    return [f"{text}: {cut}, or bake a texture, {texture} into a .glb"]


def _can_be_fitted(plan: Plan) -> bool:
    """Whether the bake of a plan would be another by the surface method, with which some options do not go."""
    arguments = plan.arguments
    if isinstance(arguments, VertexOptions) and arguments.method == "vertex":
        with suppress(OptionError):
            replace(arguments, method="surface")
            return True
    return False


def trace(plan: Plan, inputs: BakeInputs, checkpoint: Kept) -> ao.Bake:
    """Bake, and show how far it is."""
    options = plan.options
    with progress(options.quiet, "rays", form=options.progress, status=checkpoint.status) as (advance,):
        return bake_inputs(plan, inputs, checkpoint, advance)


def bake_inputs(plan: Plan, inputs: BakeInputs, checkpoint: Kept | None, advance: Progress | None) -> ao.Bake:
    """Bake: all objects at once, or one group of them after the other."""
    options = plan.options
    if options.occluded_by != "all":
        return _bake_groups(plan, inputs)
    if inputs.source.cloud:
        return _bake_cloud(plan, inputs, inputs.source.cloud, advance)
    chosen = {"only": inputs.chosen.only, "threads": options.threads} | inputs.arguments
    arguments = VertexArguments.of(
        plan.arguments, inputs.chosen.mesh, progress=advance, checkpoint=checkpoint, **chosen
    )  # fmt: skip
    return bake_vertices(arguments)


def _bake_cloud(plan: Plan, inputs: BakeInputs, cloud: tuple[Float64s, Float64s], advance: Progress | None) -> ao.Bake:
    """Bake the points of a cloud: among themselves, or if there are others that occlude, among these alone."""
    places, normals = cloud
    from obscurance.ao.methods.point_values import TAKEN

    arguments = {name: getattr(plan.arguments, name) for name in TAKEN if name != "threads"}
    walls = inputs.occluders
    alone = plan.options.occluder is None
    if alone and len(places) < 2:
        raise MeshError(inputs.source.path, "points", "at least two, or --occluder", len(places))
    mesh = None if alone else walls[0]
    others = walls if alone else walls[1:]
    threads = plan.options.threads
    return ao.bake_points(mesh, places, normals, occluders=others, progress=advance, threads=threads, **arguments)


def _bake_groups(plan: Plan, inputs: BakeInputs) -> ao.Bake:
    """Bake groups of objects one by one, each alone among the occluders that all have; vertices of several groups have
    w of the last."""
    chosen, arguments = inputs.chosen, plan.arguments
    assert isinstance(arguments, VertexOptions)
    falloffs = tuple(chosen.absolute(falloff) for falloff in arguments.every_falloff)
    alone = replace(arguments, falloff=falloffs if len(falloffs) > 1 else falloffs[0], profile=False)
    parts = list[tuple[Int64s, ao.Bake]]()
    for vertices, faces, mesh in chosen.parts():
        only = None if chosen.only is None else chosen.only[vertices]
        given = {"only": only, "threads": plan.options.threads} | inputs.arguments
        part = bake_vertices(VertexArguments.of(alone, mesh, **given))
        parts.append((vertices if part.at == "vertices" else faces, part))
    return _joined(parts, chosen.mesh, arguments, chosen.only)


def _joined(
    parts: Sequence[tuple[Int64s, ao.Bake]], mesh: Mesh, arguments: VertexOptions, only: Bools | None
) -> ao.Bake:
    """One bake of parts of a mesh, each with its rows. Args: arguments: of the whole. only: vertices that got w."""
    bakes = [part for _, part in parts]
    wanted = only
    if bakes[0].at == "vertices":
        has_face = np.zeros(len(mesh.vertices), np.bool_)
        has_face[mesh.faces] = True
    else:
        wanted = None if only is None else np.all(only[mesh.faces], axis=1)
        has_face = np.ones(len(mesh.faces), np.bool_)

    def spread(columns: Sequence[AnyFloats], elsewhere: float) -> Float64s:
        """Values of the parts in the rows of the whole."""
        whole = np.full((len(has_face), *columns[0].shape[1:]), elsewhere)
        for (rows, _), values in zip(parts, columns, strict=True):
            whole[rows] = values
        return whole

    flags = np.where(has_face, 0, ao.Flag.UNREFERENCED).astype(np.uint8)
    for rows, part in parts:
        flags[rows] = part.flags
    w, errors = spread([part.values for part in bakes], 1.0), spread([part.errors for part in bakes], 0.0)
    rmses = np.sqrt(np.sum(errors**2, axis=0) / max(len(w) if wanted is None else int(wanted.sum()), 1)).tolist()
    further = of_columns(arguments, arguments.mus(mesh.radius), [w[:, 1:], errors[:, 1:]] if len(rmses) > 1 else [])
    calibrations = [part.calibration for part in bakes if part.calibration]
    below = [(rows, part.below) for rows, part in parts if part.below]
    return ao.Bake(
        w=w[:, 0], error=errors[:, 0], bent_normals=spread([part.bent_normals for part in bakes], 0.0), flags=flags,
        mesh=mesh, mu=bakes[0].mu, rmse=rmses[0], rmses=tuple(rmses), rays=sum(part.rays for part in bakes),
        rays_skipped=_sums([part.rays_skipped for part in bakes]), seconds=_sums([part.seconds for part in bakes]),
        shortfalls=tuple(dict.fromkeys(line for part in bakes for line in part.shortfalls)),
        calibration=Calibration(*map(np.concatenate, zip(*calibrations, strict=True))) if calibrations else None,
        at=bakes[0].at, below=_joined(below, mesh, arguments, only) if below else None, **further,
    )  # fmt: skip


def _sums(tables: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    names = dict.fromkeys(name for table in tables for name in table)
    return {name: sum(table.get(name, 0) for table in tables) for name in names}
