"""`obscurance render`: from a scene file to an image file and a report. Heavy imports wait for checked options."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ao.declared import Option
from ao.options import Normals
from raytrace.errors import OptionError

from ..jobs.console import compiling, progress, show_picture, warn
from ..jobs.options import REPORTS, ROWS, Record, check_together, command_line, plain

if TYPE_CHECKING:
    from ..jobs.remote import Workers
    from ..show.report.pictures import Picture

RENDER = (
    Option("scene", Path, ..., "A .toml scene, a .glb or .gltf, or any mesh.", metavar="SCENE"),
    replace(ROWS["output"], help="Output image, format by ending: .exr .png .tif .jpg"),
    Option("width", int | None, None, "Image width in pixels; needs --height.", needs={"height": ...}),
    Option("height", int | None, None, "Image height in pixels; needs --width.", needs={"width": ...}),
    Option("samples", int | None, None, "Most camera rays per pixel."),
    Option("shading", str | None, None, "Interpolation over a face: constant, flat, gouraud, phong or quadratic.",
           words=("constant", "flat", "gouraud", "phong", "quadratic")),
    replace(ROWS["normals"], kind=Normals | None, default=None),
    Option("obscurance", str | None, None, "What w scales: ambient (ambient light only), "
           "'ambient and diffuse' (light, as in the textbook's equation 12.75), or off (nothing)."),
    Option("baked", Path | None, None, "Read w from a baked file: .npy .npz .ply .glb"),
    Option("half_distance", str | None, None, "Of the baked file's profile: mesh units, or \"12%\" of the radius; or "
           "several with commas between, whose w are multiplied."),
    Option("power", str | None, None, "Of w at each half-distance, 1 by default: 1,0.5 for instance.",
           needs={"half_distance": ...}),
    Option("own_occlusion", bool, True, "Use a glTF file's own occlusion textures; otherwise bake there, too."),
    replace(ROWS["alpha"], help="auto: as the file has it; ignore: faces are opaque."),
    Option("shadows", bool | None, None, "Trace shadow rays."),
    replace(ROWS["up"], help="Up axis of a mesh file, by default what it says, or y."),
    Option("view", str | None, None, "Where a mesh file is seen from: front, back, left, right, top, bottom, or a "
           "direction X,Y,Z from it to the camera.", words=("front", "back", "left", "right", "top", "bottom")),
    Option("crop", str | None, None, "Render only these pixels.", metavar="X,Y,W,H"),
    replace(ROWS["seed"], kind=int | None, default=None, help="Random seed of the pixel samples."),
    Option("preview", bool, False, "A quarter of the width and height, few samples."),
    replace(ROWS["half"], help="16-bit floats in an .exr."),
    Option("show", bool, False, "Show the image in the terminal, too, or instead.", role="run"),
    *(ROWS[name] for name in ("threads", "cluster", "shared", "report", "progress", "quiet")),
)  # fmt: skip


def run_render(options: dict[str, Any]) -> None:
    """Read a scene, render it, write the image and a report, and print a summary. Raises: ObscuranceError."""
    check_together(options, RENDER)
    given, workers = Record(options), None
    if given.cluster:
        from ..jobs.remote import Workers

        workers = Workers(options)
    if given.output is not None:
        _render(given, given.output, workers)
        return
    if not given.show:
        raise OptionError("output", "an image file, or --show", "nothing")
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        _render(given.replaced(quiet=True), Path(folder) / "shown.png", workers)


def _render(given: Record, output: Path, workers: Workers | None) -> None:
    if given.show and not sys.stdout.isatty():
        raise OptionError("show", "a terminal as standard output", "a file or a pipe")
    size = None if given.width is None else (given.width, given.height)
    crop = None if given.crop is None else _crop(given.crop)
    from raytrace.image.write import check_image_target
    from raytrace.system.checks import check_ending, check_outputs
    from raytrace.system.threads import thread_count

    threads = thread_count(given.threads)
    check_image_target(output, given.half)
    if given.report:
        check_ending("--report", given.report, *REPORTS)
    outputs = {"--output": output, "--report": given.report}
    check_outputs(outputs, [given.scene])
    from ..description.read import read_scene
    from ..falloffs import make_scales
    from ..formats.stored_w import check_stored
    from ..show.report.verdict import hashed, write_report
    from .render import adjusted, make_picture, render_report

    if given.baked:
        check_stored(given.baked)
    scales = None if given.half_distance is None else make_scales(given.half_distance, given.power)
    with compiling():
        read = read_scene(given.scene, size, given.up, given.view)
        used = given.replaced(crop=crop, threads=threads)
        description = adjusted(read, used, scales)
        check_outputs(outputs, description.files)
        inputs = hashed([given.scene, *description.files]) if given.report else []
        warnings = warn((item.shape.mesh for item in description.scene.objects), description.notes)
        with workers.session(output) if workers else nullcontext() as session:
            status = session.status if session else str
            with progress(given.quiet, "rays", "tiles", form=given.progress, status=status) as bars:
                picture = make_picture(used, description, output, bars, session)
    if given.show:
        show_picture(picture.frame.layers["beauty"])
    if given.report:
        facts = render_report(given.scene, description.settings, picture, threads, warnings)
        kept = [row for row in RENDER if row.role != "run" or row.name == "threads"]
        options = {row.name: plain(getattr(given, row.name)) for row in kept}
        line = command_line("render", RENDER, options)

        def pictures() -> list[list[Picture]]:
            from ..show.report.pictures import pictures_of_frame

            return [pictures_of_frame(picture.frame)]

        write_report(given.report, "render", line, facts, inputs, options, pictures)
    if not given.quiet:
        print(picture.summary(output, description.settings))
        if session:
            print(session.summary())


def _crop(text: str) -> tuple[int, int, int, int]:
    """Left, top, width and height of "X,Y,W,H". Raises: OptionError."""
    try:
        x, y, width, height = (int(number) for number in text.split(","))
    except ValueError:
        raise OptionError("crop", "four whole numbers X,Y,W,H", repr(text)) from None
    return x, y, width, height
