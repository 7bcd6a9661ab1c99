"""`obscurance render`: from a scene file to an image file and a report. Heavy imports wait for checked options."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from raytrace.errors import OptionError

from ..jobs.console import KERNELS_OF_RENDER, compiling, progress, show_picture, warn
from ..jobs.options import REPORTS, Alpha, NormalsFrom, ProgressForm, Up, parse_crop, parse_size, plain

if TYPE_CHECKING:
    from ao.cluster.session import ClusterSession

    from ..show.report.pictures import Picture as Shown
    from .render import Picture

_SETTINGS = ("samples", "shading", "normals", "obscurance", "shadows", "seed")
_NO_OPTIONS_OF_RENDER = ("report", "quiet", "progress", "show", "open_session")  # they change no picture


@dataclass(frozen=True, kw_only=True)
class RenderCommand:
    """The command with its options; `obscurance render --help` explains each. None: as the scene has it."""

    scene: Path
    output: Path | None
    width: int | None
    height: int | None
    samples: int | None
    shading: str | None
    normals: NormalsFrom | None
    obscurance: str | None
    baked: Path | None
    own_occlusion: bool
    alpha: Alpha
    shadows: bool | None
    up: Up | None
    crop: str | None
    seed: int | None
    preview: bool
    half: bool
    threads: int | None
    report: Path | None
    quiet: bool
    progress: ProgressForm
    show: bool
    open_session: Callable[[Path], ClusterSession] | None = None

    def run(self) -> None:
        """Read a scene, render it, write the image and a report, and print a summary.

        Raises:
            InputError, OutputError, EmbreeError: as `read_scene`, `adjusted` and `make_picture`.
        """
        if self.output is not None:
            self._render(self.output)
            return
        if not self.show:
            raise OptionError("output", "an image file, or --show", "nothing")
        with TemporaryDirectory() as folder:
            replace(self, quiet=True)._render(Path(folder) / "shown.png")

    def _render(self, output: Path) -> None:
        if self.show and not sys.stdout.isatty():
            raise OptionError("show", "a terminal as standard output", "a file or a pipe")
        size = parse_size(self.width, self.height)
        settings = {name: getattr(self, name) for name in _SETTINGS}
        settings["crop"] = None if self.crop is None else parse_crop(self.crop)
        from raytrace.image.write import check_image_target
        from raytrace.system.outputs import check_ending, check_outputs
        from raytrace.system.threads import thread_count

        threads = thread_count(self.threads)
        check_image_target(output, self.half)
        if self.report:
            check_ending("--report", self.report, *REPORTS)
        outputs = {"--output": output, "--report": self.report}
        check_outputs(outputs, [self.scene])
        from ..description.read import read_scene
        from ..formats.stored_w import check_stored
        from ..show.report.inputs import hashed
        from .render import adjusted, make_picture, render_report

        if self.baked:
            check_stored(self.baked)
        with compiling(KERNELS_OF_RENDER):
            read = read_scene(self.scene, size, self.up)
            description = adjusted(read, settings, self.preview, self.baked, self.own_occlusion, self.alpha)
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
            made = render_report(self.scene, description.settings, picture, threads, warnings)
            self._write_report(self.report, made, picture, inputs)
        if not self.quiet:
            print(picture.summary(output, description.settings))
            if session:
                print(session.summary())

    def _write_report(
        self, path: Path, report: dict[str, Any], picture: Picture, inputs: Sequence[Mapping[str, Any]]
    ) -> None:
        from ..show.report.complete import complete, write_report

        options = {name: plain(value) for name, value in vars(self).items() if name not in _NO_OPTIONS_OF_RENDER}

        def pictures() -> list[list[Shown]]:
            from ..show.report.pictures import pictures_of_frame

            return [pictures_of_frame(picture.frame)]

        write_report(path, complete("render", "scene", report, inputs, options), pictures)


def render_command(options: dict[str, Any]) -> RenderCommand:
    """The command for `render`, with `--cluster` and `--shared` if they are given.

    Raises: OptionError: as `Workers`, or `--shared` alone.
    """
    from ..jobs.workers import Workers

    address, shared = options.pop("cluster"), options.pop("shared")
    if address:
        workers = Workers(address, shared, options["threads"])
        return RenderCommand(**options, open_session=workers.session)
    if shared:
        raise OptionError("shared", "--cluster with it", "none")
    return RenderCommand(**options)
