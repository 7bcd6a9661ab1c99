"""`obscurance render`: from a scene file to an image file and a report. Heavy imports wait for checked options."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ao.declared import Option
from ao.options import Normals
from raytrace.errors import OptionError

from ..jobs.console import compiling, progress, show_picture, warn
from ..jobs.options import REPORTS, ROWS, Record, check_together, command_line, plain

if TYPE_CHECKING:
    from ao.cluster.session import ClusterSession

    from ..show.report.pictures import Picture
    from .render import RenderedPicture

_SETTINGS = ("samples", "shading", "normals", "obscurance", "shadows", "seed")
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


class RenderCommand(Record):
    """The command with its options as attributes; None: as the scene has it. Attributes: open_session: of workers."""

    open_session: Callable[[Path], ClusterSession] | None = None

    def run(self) -> None:
        """Read a scene, render it, write the image and a report, and print a summary.

        Raises: InputError, OutputError, EmbreeError: as `read_scene`, `adjusted` and `make_picture`.
        """
        if self.output is not None:
            self._render(self.output)
            return
        if not self.show:
            raise OptionError("output", "an image file, or --show", "nothing")
        from tempfile import TemporaryDirectory

        with TemporaryDirectory() as folder:
            self.replaced(quiet=True)._render(Path(folder) / "shown.png")

    def _render(self, output: Path) -> None:
        if self.show and not sys.stdout.isatty():
            raise OptionError("show", "a terminal as standard output", "a file or a pipe")
        size = None if self.width is None else (self.width, self.height)
        settings = {name: getattr(self, name) for name in _SETTINGS}
        settings["crop"] = None if self.crop is None else _crop(self.crop)
        from raytrace.image.write import check_image_target
        from raytrace.system.checks import check_ending, check_outputs
        from raytrace.system.threads import thread_count

        threads = thread_count(self.threads)
        check_image_target(output, self.half)
        if self.report:
            check_ending("--report", self.report, *REPORTS)
        outputs = {"--output": output, "--report": self.report}
        check_outputs(outputs, [self.scene])
        from ..description.read import read_scene
        from ..falloffs import make_scales
        from ..formats.stored_w import check_stored
        from ..show.report.verdict import complete, hashed, write_report
        from .render import adjusted, make_picture, render_report

        if self.baked:
            check_stored(self.baked)
        scales = None if self.half_distance is None else make_scales(self.half_distance, self.power)
        with compiling():
            read = read_scene(self.scene, size, self.up, self.view)
            description = adjusted(read, settings, self.preview, self.baked, self.own_occlusion, self.alpha, scales)
            check_outputs(outputs, description.files)
            inputs = hashed([self.scene, *description.files]) if self.report else []
            warnings = warn((item.shape.mesh for item in description.scene.objects), description.notes)
            with self.open_session(output) if self.open_session else nullcontext() as session:
                status = session.status if session else str
                with progress(self.quiet, "rays", "tiles", form=self.progress, status=status) as (rays, tiles):
                    picture = make_picture(self.scene, description, output, self.half, threads, rays, tiles, session)
        if self.show:
            show_picture(picture.frame.layers["beauty"])
        if self.report:
            facts = render_report(self.scene, description.settings, picture, threads, warnings)
            kept = [row for row in RENDER if row.role != "run" or row.name == "threads"]
            options = {row.name: plain(getattr(self, row.name)) for row in kept}
            line = command_line("render", RENDER, options)
            write_report(self.report, complete("render", line, facts, inputs, options), partial(_pictures, picture))
        if not self.quiet:
            print(picture.summary(output, description.settings))
            if session:
                print(session.summary())


def _pictures(picture: RenderedPicture) -> list[list[Picture]]:
    from ..show.report.pictures import pictures_of_frame

    return [pictures_of_frame(picture.frame)]


def _crop(text: str) -> tuple[int, int, int, int]:
    """Left, top, width and height of "X,Y,W,H". Raises: OptionError."""
    try:
        x, y, width, height = (int(number) for number in text.split(","))
    except ValueError:
        raise OptionError("crop", "four whole numbers X,Y,W,H", repr(text)) from None
    return x, y, width, height


def render_command(options: dict[str, Any]) -> RenderCommand:
    """The command for `render`, with `--cluster` and `--shared` if they are given.

    Raises: OptionError: as `Workers`, or options do not go together.
    """
    check_together(options, RENDER)
    if not options["cluster"]:
        return RenderCommand(options)
    from ..jobs.remote import Workers

    workers = Workers(options["cluster"], options["shared"], options["threads"])
    return RenderCommand(options, open_session=workers.session)
