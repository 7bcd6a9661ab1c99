"""A bake to a texture: from the meshes of a plan to images of w and its companions, or a .glb, and a report."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from obscurance import ao
from obscurance.ao.baking import VertexArguments, bake_vertices
from obscurance.ao.memory import bytes_of_texture
from obscurance.ao.report import report
from obscurance.ao.texture.bake_texture import TextureArguments, bake_page
from obscurance.ao.texture.uv_layout import covered_texels, on_page
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.system.atomic import write_bytes
from obscurance.raytrace.system.checks import check_outputs

from ..formats.images import write_grey, write_normals
from ..show.progress import progress
from .console import texture_summary, warn
from .pages import Layout, Page, lacking, layout_remarks, outputs_of
from .record import Record
from .report import OutputSummary, WorkSize, hashed_inputs, write_bake_report

if TYPE_CHECKING:
    from obscurance.ao.execute.kept import Kept

    from ..show.report.pictures import Picture
    from .inputs import BakeInputs
    from .plan import OpenCheckpoint, Plan


class BakedPage(NamedTuple):
    """A page as reports have it."""

    title: str
    baked: ao.BakedTexture
    seconds: dict[str, float]  # of reading and writing
    warnings: list[str]


def work_size(plan: Plan, inputs: BakeInputs) -> WorkSize:
    """The size of the bake."""
    layout = inputs.layout
    assert layout
    width, height = layout.coordinates.size
    arguments = plan.arguments
    covered = max(covered_texels(page.uv, layout.coordinates.size) for page in layout.pages)
    blocks = arguments.tolerance is not None and inputs.arguments["high"] is None
    needed = bytes_of_texture(inputs.solids, arguments, width * height, covered, blocks)
    return WorkSize(len(layout.pages) * width * height, "texels", needed)


def run(plan: Plan, inputs: BakeInputs, open_checkpoint: OpenCheckpoint) -> Iterator[OutputSummary]:
    """Bake and write, one page after the other. Raises: as `ao.bake_texture` and writers."""
    layout = inputs.layout
    assert layout
    check_outputs(outputs_of(plan, layout.pages), inputs.files)
    loaded = time.perf_counter() - inputs.started
    hashes = hashed_inputs(plan, inputs) if plan.options.report else []
    warnings = _warn(plan, inputs, layout)
    bakes: list[BakedPage] = []
    with ExitStack() as until_written:
        # Rows of the pages of a .glb are kept until it is written.
        of_glb = until_written.enter_context(open_checkpoint(plan.output)) if plan.glb == plan.output else None
        record = Record.of(plan, inputs.source.mesh).text
        for page in layout.pages:
            checkpoint = of_glb or until_written.enter_context(open_checkpoint(page.path(plan.output)))
            baked = trace_page(plan, inputs, layout, page, checkpoint)
            title = f"{page.path(plan.output)}{f', {page.name}' if page.name else ''}"
            new_warnings = _warn_of_page(plan, baked, page, title, bakes)
            begun = time.perf_counter()
            with progress(plan.options.quiet, "writing", form=plan.options.progress):
                _write_images(plan, baked, page, record)
            seconds = {"load": loaded, "write": time.perf_counter() - begun}
            bakes.append(BakedPage(title, baked, seconds, [*warnings, *new_warnings]))
            if not plan.glb:
                until_written.close()
                yield OutputSummary(texture_summary(baked, title) + inputs.alpha, bakes[-1].warnings)
        # A .glb is written once all of its pages are baked.
        if plan.glb:
            begun = time.perf_counter()
            with progress(plan.options.quiet, "writing", form=plan.options.progress):
                bakes[-1].warnings.extend(_write_glb(plan.glb, plan, inputs, layout, bakes, record))
            bakes[-1].seconds["write"] += time.perf_counter() - begun
            text = "\n".join(texture_summary(page.baked, page.title) for page in bakes)
            in_all = dict.fromkeys(line for page in bakes for line in page.warnings)
            yield OutputSummary(text + inputs.alpha, list(in_all))
    if plan.options.report:
        _write_report(plan, bakes, hashes, inputs.source.mesh)


def _warn(plan: Plan, inputs: BakeInputs, layout: Layout) -> list[str]:
    """Print, and return, warnings about the meshes and their texture coordinates."""
    source = inputs.source
    remarks = lacking(source, layout.coordinates.uv, inputs.chosen.receive, plan.keeps_uv)
    if cramped := layout.coordinates.cramped:
        smaller = f"{cramped:,} faces have charts smaller than a texel and show texels of other faces"
        remarks.append(f"{source.path}: {smaller}; a larger --size or --uv unwrap gives them texels")
    return warn(inputs.meshes, [*inputs.notes, *remarks], plan.falloff)


def _warn_of_page(
    plan: Plan, baked: ao.BakedTexture, page: Page, title: str, earlier: Sequence[BakedPage]
) -> list[str]:
    """Print, and return, warnings about a page, by its title, that no earlier one has given."""
    remarks = layout_remarks(baked, page.wraps, plan.ending != ".glb")
    known = {line for one in earlier for line in one.warnings}
    lines = [*baked.shortfalls, *(f"{title}: {line}" for line in remarks)]
    return warn([], [line for line in lines if line not in known])


def trace_page(plan: Plan, inputs: BakeInputs, layout: Layout, page: Page, checkpoint: Kept) -> ao.BakedTexture:
    """Bake one page."""
    options = plan.options
    with progress(options.quiet, "rays", form=options.progress, status=checkpoint.status) as (advance,):
        arguments = TextureArguments.of(
            plan.arguments, inputs.chosen.of_page(page.uv), uv=page.uv, size=layout.coordinates.size,
            wrap=page.wraps, falloff=layout.falloff, threads=options.threads, progress=advance, checkpoint=checkpoint,
            **inputs.arguments,
        )  # fmt: skip
        baked = bake_page(arguments)
    return baked if page.shown is None else replace(baked, uv=page.shown)


def _write_images(plan: Plan, baked: ao.BakedTexture, page: Page, record: str) -> None:
    """Write a page's images: w, bent normals and errors, as far as the plan asks for them."""
    options = plan.options
    bits = int(options.bits or 16)
    images = {name: page.path(path) for name, path in plan.images.items()}
    if "output" in images:
        described = {"content": "w, 1 = open", "seed": str(options.seed), "bake": record}
        write_grey(images["output"], baked.w, options.half, described, bits, baked.profile)
    if "bent_normals" in images:
        spaces = {"tangent": "tangent space, +Y", "tangent-directx": "tangent space, -Y"}
        described = {"content": f"bent normals in {spaces.get(options.bent_space, 'the space of the mesh')}"}
        write_normals(images["bent_normals"], baked.bent_normals, options.half, described, bits)
    if "error_map" in images:
        write_grey(images["error_map"], baked.error, options.half, {"content": "standard error of w"})


def _write_glb(
    path: Path, plan: Plan, inputs: BakeInputs, layout: Layout, bakes: Sequence[BakedPage], record: str
) -> list[str]:
    """Write the .glb, with w of vertices where there are no texture coordinates; returns warnings."""
    from ..formats.gltf.textured import textured_glb

    source = inputs.source
    textures = [page.baked for page in bakes]
    uncovered = inputs.chosen.receive & ~np.any([on_page(texture.uv) for texture in textures], axis=0)
    w = None
    if uncovered.any():
        only = np.zeros(len(source.mesh.vertices), np.bool_)
        for run in source.runs():
            only[source.mesh.faces[run.faces]] |= uncovered[run.faces].any()
        options = {"falloff": layout.falloff, "threads": plan.options.threads, "only": only}
        w = bake_vertices(VertexArguments.of(plan.arguments, inputs.chosen.mesh, **options, **inputs.arguments)).w
    content, lines = textured_glb(source, textures, plan.options.replace_occlusion, plan.options.orm, w, record)
    write_bytes(path, content)
    return warn([], [f"{path}: {line}" for line in lines])


def _write_report(plan: Plan, bakes: Sequence[BakedPage], inputs: list[dict[str, Any]], mesh: Mesh) -> None:
    """Write the report of all pages, if the plan asks for one."""
    options = plan.described()
    reports = [report(page.baked, options, page.seconds, page.warnings) for page in bakes]
    whole = reports[0]
    if len(bakes) > 1:
        whole = {"pages": {page.title: facts for page, facts in zip(bakes, reports, strict=True)}}

    def pictures() -> list[list[Picture]]:
        from ..show.report.pictures import pictures_of_page

        shown = mesh if len(bakes) == 1 else None
        return [pictures_of_page(shown, page.baked) for page in bakes]

    write_bake_report(plan, whole, inputs, pictures)
