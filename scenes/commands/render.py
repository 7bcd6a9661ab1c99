"""`obscurance render`: from a scene file to a picture and a report. Heavy imports wait for checked options."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from obscurance.raytrace.errors import ConflictError, OptionError, printable

from ..bake.console import warn
from ..bake.options import RENDER, REPORTS, RenderOptions, check_together, plain
from ..bake.report import command_line
from ..show.progress import progress

if TYPE_CHECKING:
    from obscurance import ao
    from obscurance.ao.cluster.workers import Workers
    from obscurance.raytrace import Frame, Settings
    from obscurance.raytrace.types import Float32s

    from ..description.description import SceneDescription
    from ..formats.stored_w import Scales
    from ..show.progress import Advance
    from ..show.report.pictures import Picture

_SETTINGS = ("samples", "shading", "normals", "obscurance", "shadows", "seed")
_PREVIEW = 4  # a preview's sides are that much shorter
_PREVIEW_BAKE = 32  # and it bakes with that many rays a vertex


def run_render(options: RenderOptions) -> None:
    """Read a scene, render it, write the image and a report, and print a summary. Raises: ObscuranceError."""
    check_together(options, RENDER)
    if options.output is not None:
        _render(options, options.output)
        return
    if not options.show:
        raise OptionError("output", "an image file, or --show", "nothing")
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        _render(options.replaced(quiet=True), Path(folder) / "shown.png")


def _render(options: RenderOptions, output: Path) -> None:
    """Check the options, read the scene, bake and render it, write what is asked for, and print a line."""
    # Everything that can be wrong without the scene.
    if options.show and not sys.stdout.isatty():
        raise OptionError("show", "a terminal as standard output", "a file or a pipe")
    size = None if options.width is None else (options.width, options.height)
    crop = None if options.crop is None else _crop(options.crop)
    from obscurance.raytrace.image.write import check_image_target
    from obscurance.raytrace.system.checks import check_ending, check_outputs
    from obscurance.raytrace.system.threads import thread_count

    threads = thread_count(options.threads)
    layers = check_image_target(output, options.half)
    if options.report:
        check_ending("--report", options.report, *REPORTS)
    from ..bake.run import workers_of
    from ..description.read import read_scene
    from ..falloffs import make_scales
    from ..formats.stored_w import check_stored
    from ..show.report.verdict import hashed

    if options.baked:
        check_stored(options.baked)
    scales = None if options.half_distance is None else make_scales(options.half_distance, options.power)
    # The scene as the options have it.
    read = read_scene(options.scene, size, options.up, options.view)
    description = _adjusted(read, options.replaced(crop=crop), scales)
    views, targets = _views(description, options.turntable, output)
    for target in targets:
        check_outputs({"--output": target, "--report": options.report}, [options.scene, *description.files])
    inputs = hashed([options.scene, *description.files]) if options.report else []
    warnings = warn((item.shape.mesh for item in description.scene.objects), description.notes)
    # Its pictures, each of which is written as soon as it is there.
    lines = []
    with workers_of(options) as workers:
        status = workers.status if workers else str
        with progress(options.quiet, "rays", "tiles", form=options.progress, status=status) as bars:
            pictures = _pictures(options.scene, views, layers is None, threads, bars, workers)
            for target, picture in zip(targets, pictures, strict=True):
                start = time.perf_counter()
                picture.frame.save(target, _metadata(options.scene, description.settings), options.half)
                picture.seconds["write"] = time.perf_counter() - start
                lines.append(picture.summary(target, description.settings))
    if options.show:
        show_picture(picture.frame.layers["beauty"])
    if options.report:
        _write_report(options, description.settings, picture, threads, inputs, warnings)
    if not options.quiet:
        print("\n".join(lines))
        if workers:
            print(workers.summary())


def _views(
    description: SceneDescription, turntable: int | None, output: Path
) -> tuple[list[SceneDescription], list[Path]]:
    """The pictures to render, several of a turntable, and the file of each."""
    if turntable is None:
        return [description], [output]
    views = description.turntable(turntable)
    return views, [output.with_stem(f"{output.stem}_{number:04}") for number in range(1, len(views) + 1)]


def _crop(text: str) -> tuple[int, int, int, int]:
    """Left, top, width and height of "X,Y,W,H". Raises: OptionError."""
    try:
        x, y, width, height = map(int, text.split(","))
    except ValueError:
        raise OptionError("crop", "four whole numbers X,Y,W,H", repr(text)) from None
    return x, y, width, height


def _adjusted(description: SceneDescription, options: RenderOptions, scales: Scales | None) -> SceneDescription:
    """The description changed by the options. A preview is a quarter as wide and high, with few rays.

    Raises: OptionError.
    """
    # Settings, where w comes from, and the bake.
    changes = {name: getattr(options, name) for name in ("crop", *_SETTINGS) if getattr(options, name) is not None}
    settings = replace(description.settings, **changes)
    w_from = description.w_from
    files = description.files
    if settings.obscurance == "off":
        if options.baked is not None:
            raise ConflictError("baked", "does not go with", ("obscurance", "off"))
        w_from = "off"
    elif options.baked is not None:
        w_from = options.baked
        files = (*files, options.baked)
    elif w_from == "off":
        w_from = "bake"
    bake = description.bake
    if options.preview:
        settings = _quarter(settings)
        bake = replace(bake, samples=min(bake.rays, _PREVIEW_BAKE))
    # The scene, and half-distances of its w.
    scene = description.scene if options.own_occlusion else description.scene.without_occlusion()
    if options.alpha == "ignore":
        scene = scene.without_alpha()
    if scales and not isinstance(w_from, Path):
        raise ConflictError("half_distance", "needs", "baked")
    scales = scales or (None if options.baked else description.scales)
    return replace(description, scene=scene, settings=settings, w_from=w_from, bake=bake, files=files, scales=scales)


def _quarter(settings: Settings) -> Settings:
    """Settings of a preview: size and crop divided by `_PREVIEW`, at most four samples."""
    width = max(settings.width // _PREVIEW, 1)
    height = max(settings.height // _PREVIEW, 1)
    crop = settings.crop
    if crop:
        x = min(crop[0] // _PREVIEW, width - 1)
        y = min(crop[1] // _PREVIEW, height - 1)
        crop = x, y, min(max(crop[2] // _PREVIEW, 1), width - x), min(max(crop[3] // _PREVIEW, 1), height - y)
    return replace(settings, width=width, height=height, crop=crop, samples=min(settings.samples, 4))


class RenderedPicture(NamedTuple):
    frame: Frame  # the layers that the file's format holds, and the renderer's counts
    bake: ao.Bake | None
    seconds: dict[str, float]  # bake, build, render, write

    def summary(self, target: Path, settings: Settings) -> str:
        """The line after a rendering: file, size, rays, times."""
        traced = sum(self.frame.rays.values())
        skipped = sum(self.frame.rays_skipped.values())
        rays = f"{traced / 1e6:.1f} M rays traced and {skipped / 1e6:.1f} M skipped in {self.seconds['render']:.2f} s"
        baked = f", baked in {self.seconds['bake']:.2f} s" if self.bake else ""
        size = f"{settings.width}×{settings.height}"
        return f"{printable(str(target))}: {size}, {rays}; obscurance {settings.obscurance}{baked}"


def _pictures(
    source: Path, views: Sequence[SceneDescription], all_layers: bool, threads: int, bars: Sequence[Advance | None],
    workers: Workers | None,
) -> Iterator[RenderedPicture]:  # fmt: skip
    """Bake what a described scene needs, once, and render its views, which differ by camera and lights.

    Args:
        all_layers: as of `raytrace.render`.
        bars: progress of baking, and of rendering.
    """
    from obscurance.raytrace.renderer.render import describe_work, render, rendering_bytes
    from obscurance.raytrace.system.checks import check_memory

    from ..description.obscurance import with_obscurance

    description = views[0]
    settings = description.settings
    renderer = render
    checkpoint = None
    if workers:
        from obscurance.ao.cluster.pictures import render_on

        from ..bake.run import kept_by

        renderer = partial(render_on, workers)
        checkpoint = kept_by(workers, None)
    needed = rendering_bytes(description.scene, settings, all_layers, threads)
    check_memory(source, needed, describe_work(description.scene, settings))
    start = time.perf_counter()
    scene, baked = with_obscurance(description, threads, bars[0], checkpoint, [view.camera for view in views])
    bake_seconds = time.perf_counter() - start
    for view in views:
        lit = replace(scene, lights=view.scene.lights)
        frame = renderer(lit, view.camera, settings, all_layers, threads, bars[1])
        yield RenderedPicture(frame, baked, {"bake": bake_seconds, **frame.seconds})
        baked, bake_seconds = None, 0.0


def _metadata(source: Path, settings: Settings) -> dict[str, str]:
    """Metadata of a picture's file: nothing that changes between runs."""
    from obscurance.ao.report import versions

    names = ("samples", "seed", "shading", "normals", "obscurance")
    described = {name: str(getattr(settings, name)) for name in names}
    return {"scene": source.name, "version": versions()["obscurance"], **described}


def _write_report(
    options: RenderOptions,
    settings: Settings,
    picture: RenderedPicture,
    threads: int,
    inputs: Sequence[dict[str, Any]],
    warnings: Sequence[str],
) -> None:
    """Write the report of a rendering, as JSON or as a page with its pictures."""
    from ..show.report.verdict import write_report

    def pictures() -> list[list[Picture]]:
        from ..show.report.pictures import pictures_of_frame

        return [pictures_of_frame(picture.frame)]

    rows = [row for row in RENDER if row.role != "run" or row.name == "threads"]
    reported = {row.name: plain(getattr(options, row.name)) for row in rows}
    line = command_line("render", RENDER, reported)
    facts = _report(options.scene, settings, picture, threads, warnings)
    write_report(options.report, "render", line, facts, inputs, reported, pictures)


def _report(
    source: Path, settings: Settings, picture: RenderedPicture, threads: int, warnings: Sequence[str]
) -> dict[str, Any]:
    """The report of a rendering as JSON-ready values."""
    from obscurance.ao.report import SCHEMA_VERSION, calibration_facts, versions

    bake = picture.bake
    frame = picture.frame
    beauty = frame.layers["beauty"]
    skipped = {f"bake_{reason}": count for reason, count in bake.rays_skipped.items()} if bake else {}
    return {
        "schema_version": SCHEMA_VERSION,
        "scene": str(source),
        "layers": {name: layer.shape[2] for name, layer in frame.layers.items()},
        "picture": {
            "covered": float(beauty[..., 3].mean()),
            "brightest": float(beauty[..., :3].max()),
            "clipped": float((beauty[..., :3] > 1).any(axis=2).mean()),
        },
        "settings": vars(settings) | {"threads": threads},
        "rays": frame.rays | ({"bake": bake.rays} if bake else {}),
        "rays_skipped": frame.rays_skipped | skipped,
        "seconds": picture.seconds,
        "rmse_estimate": bake.rmse if bake else None,
        "error_calibration": calibration_facts(bake.calibration) if bake else None,
        "warnings": list(warnings),
        "versions": versions(),
    }


def show_picture(pixels: Float32s) -> None:
    """Print a picture, linear RGB, in the terminal's colours, at most as wide: two pixels a character, in a column.

    Not the terminal writer of OpenImageIO, which prints `\\u2580` in these six letters instead of the half block.
    """
    from rich.color import Color
    from rich.console import Console
    from rich.style import Style
    from rich.text import Text

    from obscurance.raytrace.image.colour import encode_srgb

    from ..show.page.base_colour import block_means

    console = Console()
    half, step = ("▀", 2) if "utf" in console.encoding.lower() else (" ", 1)
    height, width = pixels.shape[:2]
    wide = min(console.width, width)
    high = max(round(height * wide / width * step / 2 / step), 1) * step  # characters are twice as high as wide
    codes = (255 * encode_srgb(block_means(pixels[..., :3], high, wide).astype("f4")) + 0.5).astype(int)
    for lines in zip(*(codes[offset::step] for offset in range(step)), strict=True):
        text = Text(no_wrap=True, end="\n")
        for column in range(codes.shape[1]):
            upper = Color.from_rgb(*lines[0][column])
            lower = Color.from_rgb(*lines[-1][column])
            text.append(half, Style(color=upper, bgcolor=lower))
        console.print(text)
