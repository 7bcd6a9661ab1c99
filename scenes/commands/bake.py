"""`obscurance bake`: from a mesh file to w, a report and an image of the flagged vertices."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings

from .console import KERNELS_OF_BAKE, KERNELS_OF_SURFACE, bake_summary, compiling, note, progress, warn
from .options import FalloffForm, Hidden, Method, NormalsFrom, Occlusion, Traversal, Up, make_falloff, named, plain

if TYPE_CHECKING:
    import ao
    from ao.trace.checkpoint import Checkpoint
    from raytrace.mesh.mesh import Mesh

_NO_OPTIONS_OF_BAKE = ("report", "quiet", "resume", "checkpoint")  # they change no result


def usual_checkpoint(resume: bool, target: Path) -> Checkpoint:
    """A journal beside the target."""
    from ao.trace.checkpoint import Checkpoint

    return Checkpoint(f"{target}.partial", resume, note)


@dataclass(frozen=True, kw_only=True)
class BakeCommand:
    """The command with its options; `obscurance bake --help` explains each.

    Attributes:
        checkpoint: makes the checkpoint of the bake to a file, None for the usual one.
    """

    mesh: Path
    output: Path
    method: Method
    falloff: FalloffForm
    tau: float | None
    half_distance: str | None
    max_distance: str
    samples: int | None
    tolerance: float | None
    reconstruct: bool
    traversal: Traversal
    seed: int
    threads: int | None
    normals: NormalsFrom
    hidden: Hidden
    report: Path | None
    debug_image: Path | None
    up: Up | None
    resume: bool
    colors: bool
    occlusion: Occlusion | None
    replace_occlusion: bool
    quiet: bool
    checkpoint: Callable[[Path], Checkpoint] | None = None

    def run(self) -> None:
        """Bake, write, and print a summary.

        Raises:
            InputError: an option, the mesh, or options that exclude each other.
            OutputError, MemoryLimitError, EmbreeError: as `ao.bake` and `scenes.write`.
        """
        falloff = self._check()
        with compiling(KERNELS_OF_BAKE if self.method == "vertex" else KERNELS_OF_SURFACE):
            self._run(falloff)

    def _run(self, falloff: ao.Falloff) -> None:
        from raytrace.system.outputs import check_outputs

        from ..readers.load import load
        from ..writers.losses import lost
        from ..writers.write import channels, write

        start = time.perf_counter()
        source = load(self.mesh, self.output)
        check_outputs(self._outputs(), source.files)
        loaded = time.perf_counter()
        warnings = warn(
            [source.mesh], [*source.notes, *lost(self.output, source, channels(self.output, **self._channels()))]
        )
        with (self.checkpoint or partial(usual_checkpoint, self.resume))(self.output) as checkpoint:
            baked, unmet = self._bake(source.mesh, falloff, checkpoint)
            warnings += warn([], unmet)
            tracing = time.perf_counter()
            write(self.output, baked, source, **self._channels())
        seconds = {"load": loaded - start, "write": time.perf_counter() - tracing}
        if self.report:
            self._write_report(self.report, baked, seconds, warnings)
        if self.debug_image:
            from ..description.defaults import up_axis
            from .flag_image import write_marked

            write_marked(self.debug_image, source.mesh, baked, up_axis(self.mesh, self.up))
        if not self.quiet:
            print(bake_summary(baked, self.output))

    def _check(self) -> ao.Falloff:
        """The falloff, if the options go together and the outputs can be written. Raises: OptionError, OutputError."""
        from ao.options import Options
        from raytrace.errors import OptionError
        from raytrace.system.outputs import check_ending, check_outputs

        from ..writers.write import channels, check_target

        falloff = make_falloff(self.falloff, self.tau, self.half_distance, self.max_distance)
        Options(**self._options())
        check_target(self.output)
        channels(self.output, **self._channels())
        if self.report:
            check_ending("--report", self.report, ".json")
        if self.debug_image:
            from raytrace.image.write import check_image_target

            with named("debug_image"):
                check_image_target(self.debug_image, layers=("beauty",))
        elif self.up:
            raise OptionError("up", "--debug-image with it; w does not depend on it", "none")
        check_outputs(self._outputs(), [self.mesh])
        return falloff

    def _outputs(self) -> dict[str, Path | None]:
        return {"--output": self.output, "--report": self.report, "--debug-image": self.debug_image}

    def _channels(self) -> dict[str, Any]:
        """The options of `scenes.write`."""
        return {name: getattr(self, name) for name in ("colors", "occlusion", "replace_occlusion")}

    def _options(self) -> dict[str, Any]:
        """The options that `ao.bake` takes."""
        names = ("method", "samples", "seed", "threads", "normals", "tolerance", "reconstruct", "hidden", "traversal")
        return {name: plain(getattr(self, name)) for name in names}

    def _bake(self, mesh: Mesh, falloff: ao.Falloff, checkpoint: Checkpoint) -> tuple[ao.Bake, list[str]]:
        """The bake, and warnings that a tolerance was not met."""
        import ao

        unmet = catch_warnings(record=True, action="always", category=ao.ToleranceWarning)
        with progress(self.quiet, "rays", status=checkpoint.status) as (advance,), unmet as raised:
            baked = ao.bake(mesh, falloff, progress=advance, checkpoint=checkpoint, **self._options())
        return baked, [str(warning.message) for warning in raised]

    def _write_report(self, path: Path, baked: ao.Bake, seconds: dict[str, float], warnings: list[str]) -> None:
        from ao.report import report
        from raytrace.system.atomic import write_json
        from raytrace.system.threads import thread_count

        from ..writers.write import channels

        options = {name: plain(value) for name, value in vars(self).items() if name not in _NO_OPTIONS_OF_BAKE}
        options["threads"] = thread_count(self.threads)
        options["occlusion"] = "ramp" if channels(self.output, **self._channels()).ramp else "none"
        write_json(path, report(baked, options, seconds, warnings))
