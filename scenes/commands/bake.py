"""`obscurance bake`: from a mesh file to w, a report and an image of the flagged vertices."""

from __future__ import annotations

import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from warnings import catch_warnings, simplefilter

from .console import KERNELS_OF_BAKE, KERNELS_OF_SURFACE, alpha_summary, bake_summary, compiling, note, progress, warn
from .options import (
    CAGE,
    REPORTS,
    Alpha,
    Hidden,
    Method,
    NormalsFrom,
    Occlusion,
    ProgressForm,
    Traversal,
    Up,
    check_cage,
    named,
    plain,
)

if TYPE_CHECKING:
    import ao
    from ao.trace.checkpoint import Checkpoint

    from ..readers.load import MeshFile
    from ..report.pictures import Picture

NO_OPTIONS_OF_BAKE = frozenset(
    {"report", "quiet", "resume", "progress", "content", "open_checkpoint"}
)  # they change no result


@contextmanager
def told_shortfalls() -> Iterator[None]:
    """No warnings of Python's about tolerances that are not met, while this lasts: commands print them as their own."""
    import ao

    with catch_warnings():
        simplefilter("ignore", ao.ToleranceWarning)
        yield


class Work(NamedTuple):
    """What a bake is made of.

    Attributes:
        points: how many are baked, at most. unit: what they are, "vertices" or "texels".
        bytes: memory that the bake takes at its peak.
        trial: bakes about so many of the points, to see how long that takes; returns how many.
    """

    points: int
    unit: str
    bytes: int
    trial: Callable[[int], int]


class Written(NamedTuple):
    """An output that was written: its summary, and warnings about it, which have been printed."""

    summary: str
    warnings: list[str]


@dataclass(frozen=True, kw_only=True)
class MeshBake(ABC):
    """The options of a bake of a mesh file, to vertices or a texture; `obscurance bake --help` explains each."""

    mesh: Path
    output: Path
    falloff: str
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
    alpha: Alpha
    up: Up | None
    report: Path | None
    resume: bool
    occlusion: Occlusion | None
    replace_occlusion: bool
    high: Path | None
    cage: str | None
    quiet: bool
    progress: ProgressForm = "bar"
    content: bytes | None = None
    """Of the mesh, if it is no file's."""
    open_checkpoint: Callable[[Path], AbstractContextManager[Checkpoint]] | None = None
    """Makes the checkpoint of an output, if not the usual one is wanted."""

    def run(self) -> int:
        """Bake, write, and print a summary. Returns: the exit status, 0.

        Raises:
            InputError: an option, the mesh, or options that exclude each other.
            OutputError, MemoryLimitError, EmbreeError: as `ao.bake`, `ao.bake_texture` and when writing.
        """
        from raytrace.system.atomic import is_standard_output

        falloff = self.check()
        with compiling(self.kernels), told_shortfalls():
            for written in self.bake(falloff):
                if not self.quiet:
                    print(written.summary, file=sys.stderr if is_standard_output(self.output) else sys.stdout)
        return 0

    def check(self) -> ao.Falloff:
        """The falloff, if the options go together and the outputs can be written. Raises: OptionError, OutputError."""
        from ao.options import Options
        from raytrace.system.outputs import check_ending, check_outputs

        from ..falloffs import make_falloff

        falloff = make_falloff(self.falloff, self.tau, self.half_distance, self.max_distance)
        Options(**self.options())
        self.check_own()
        if self.report:
            check_ending("--report", self.report, *REPORTS)
        check_outputs(self.outputs(), self.inputs())
        return falloff

    def options(self) -> dict[str, Any]:
        """The options that `ao.bake` and `ao.bake_texture` take."""
        names = ("samples", "seed", "threads", "normals", "tolerance", "reconstruct", "hidden", "traversal")
        return {name: getattr(self, name) for name in names}

    def described(self) -> dict[str, Any]:
        """Every effective option, as a JSON report has it."""
        from raytrace.system.threads import thread_count

        options = {name: plain(value) for name, value in vars(self).items() if name not in NO_OPTIONS_OF_BAKE}
        return options | {"threads": thread_count(self.threads)}

    def hashed(self, files: Iterable[Path]) -> list[dict[str, Any]]:
        """Files that were read, as a report has them; nothing if there is none to write."""
        from ..falloffs import table_of
        from ..report.inputs import hashed

        return hashed([*files, *table_of(self.falloff)], {self.mesh: self.content}) if self.report else []

    def checkpoint(self, output: Path) -> AbstractContextManager[Checkpoint | None]:
        """Keeps what is traced for an output, beside it; none beside standard output."""
        from ao.trace.checkpoint import Checkpoint
        from raytrace.system.atomic import is_standard_output

        if self.open_checkpoint:
            return self.open_checkpoint(output)
        if is_standard_output(output):
            return nullcontext()
        return Checkpoint(self.journal(output), self.resume, note)

    def journal(self, output: Path) -> Path:
        """Where what is traced for an output is kept until it is written."""
        return Path(f"{output}.partial")

    def inputs(self) -> list[Path]:
        """The files that are read, as far as the options name them."""
        from ..falloffs import table_of

        return [self.mesh, *([self.high] if self.high else []), *table_of(self.falloff)]

    @property
    @abstractmethod
    def kernels(self) -> int:
        """About how many kernels the bake takes."""

    @property
    @abstractmethod
    def side_by_side(self) -> bool:
        """Whether a bake of a small file is small, too: one for a single core."""

    @abstractmethod
    def outputs(self) -> dict[str, Path | None]:
        """The files to write, by what the user calls them."""

    @abstractmethod
    def check_own(self) -> None:
        """Check the options of this sort of bake. Raises: OptionError, OutputError."""

    def read(self) -> MeshFile:
        """The mesh file, with what the output can hold of it. Raises: InputError."""
        from ..readers.load import load

        return load(self.mesh, self.kept, self.content, self.alpha == "auto", self.up)

    def check_up(self, picture: Path | None, *outputs: Path | None) -> None:
        """Raises: OptionError: `up`, and neither a picture nor an output that stands."""
        from raytrace.errors import OptionError

        standing = (".html", ".ply", ".glb")
        if self.up and not picture and not {_ending(path) for path in (*outputs, self.report)} & set(standing):
            expected = f"--debug-image or {', '.join(standing)} with it; w does not depend on it"
            raise OptionError("up", expected, "none")

    def read_high(self) -> MeshFile | None:
        """The finer mesh's file, if there is one. Raises: InputError."""
        from ..readers.load import load

        return None if self.high is None else load(self.high, alpha=self.alpha == "auto")

    @property
    @abstractmethod
    def kept(self) -> Path:
        """A name of the format for which a mesh file's details are read."""

    @abstractmethod
    def work(self, source: MeshFile, falloff: ao.Falloff) -> Work:
        """What a bake of `source` is made of. Raises: InputError: as `bake`, before anything is traced."""

    @abstractmethod
    def bake(self, falloff: ao.Falloff) -> Iterator[Written]:
        """Bake and write, one output after the other. Raises: as `run`."""


@dataclass(frozen=True, kw_only=True)
class BakeCommand(MeshBake):
    """A bake to vertices."""

    method: Method
    debug_image: Path | None
    colors: bool

    @property
    def kernels(self) -> int:
        return KERNELS_OF_BAKE if self.method == "vertex" else KERNELS_OF_SURFACE

    @property
    def side_by_side(self) -> bool:
        return True

    @property
    def kept(self) -> Path:
        return self.output

    def work(self, source: MeshFile, falloff: ao.Falloff) -> Work:
        import numpy as np

        import ao
        from ao.gather.receivers import find_receivers
        from ao.memory import surface_bytes, vertex_bytes
        from ao.options import Options
        from raytrace.mesh.placement import Placement

        mesh = (self.read_high() or source).mesh  # of whose surface points are traced
        counts = len(mesh.vertices), len(mesh.faces)
        options, points = self.options(), find_receivers(source.mesh, Placement.of(source.mesh), self.normals).points
        checked = Options(**options)
        needed = vertex_bytes(*counts, checked.rays) if self.method == "vertex" else surface_bytes(*counts)
        options["samples"] = checked.rays_in_all(len(points)) // max(len(points), 1)

        def trial(count: int) -> int:
            only = np.zeros(counts[0], bool)
            chosen = np.linspace(0, counts[0] - 1, min(count, counts[0])).astype(np.int64)
            if self.method == "surface":  # whose work is that of faces, which neighbours share
                chosen = np.arange(len(chosen)) + (counts[0] - len(chosen)) // 2
            only[chosen] = True
            ao.bake(mesh, falloff, only=only, **options)
            return len(chosen)

        return Work(len(points), "vertices", needed, trial)

    def bake(self, falloff: ao.Falloff) -> Iterator[Written]:
        import ao
        from raytrace.system.outputs import check_outputs

        from ..writers.losses import lost
        from ..writers.write import channels

        start = time.perf_counter()
        source = self.read()
        fine = self.read_high()
        check_outputs(self.outputs(), [*source.files, *(fine.files if fine else ())])
        loaded = time.perf_counter()
        inputs = self.hashed([*source.files, *(fine.files if fine else ())])
        notes = [*source.notes, *(fine.notes if fine else ())]
        warnings = warn(
            [source.mesh, *([fine.mesh] if fine else [])],
            [*notes, *lost(self.output, source, channels(self.output, **self._channels()))],
        )
        with self.checkpoint(self.output) as checkpoint:
            status = checkpoint.status if checkpoint else str
            with progress(self.quiet, "rays", form=self.progress, status=status) as (advance,):
                baked = ao.bake(
                    source.mesh, falloff, progress=advance, checkpoint=checkpoint, high=fine.mesh if fine else None,
                    cage=self.cage or CAGE, **self.options(),
                )  # fmt: skip
            warnings += warn([], [*baked.shortfalls, *self._missed(baked)])
            tracing = time.perf_counter()
            shown, more = self._write(baked, source, falloff)
            warnings += warn([], more)
        seconds = {"load": loaded - start, "write": time.perf_counter() - tracing}
        if self.report:
            self._write_report(self.report, baked, (inputs, seconds, warnings))
        if self.debug_image:
            from .flag_image import write_marked

            write_marked(self.debug_image, source.mesh, baked)
        yield Written(bake_summary(baked, self.output) + alpha_summary((fine or source).mesh) + shown, warnings)

    def check_own(self) -> None:
        from raytrace.errors import OptionError

        from ..writers.write import channels, check_target

        check_cage(self.cage, self.high)
        if self.high is not None and self.method == "surface":
            raise OptionError("high", "method vertex with it", "method surface")
        check_target(self.output)
        channels(self.output, **self._channels())
        if self.debug_image:
            from raytrace.image.write import check_image_target

            with named("debug_image"):
                check_image_target(self.debug_image, layers=("beauty",))
        self.check_up(self.debug_image, self.output)

    def outputs(self) -> dict[str, Path | None]:
        return {"--output": self.output, "--report": self.report, "--debug-image": self.debug_image}

    def options(self) -> dict[str, Any]:
        return {"method": self.method, **super().options()}

    def described(self) -> dict[str, Any]:
        from ..writers.write import channels

        ramp = channels(self.output, **self._channels()).ramp
        return super().described() | {"occlusion": "ramp" if ramp else "none"}

    def _channels(self) -> dict[str, Any]:
        """The options of `scenes.write`."""
        occlusion = None if self.occlusion == "auto" else self.occlusion
        return {"colors": self.colors, "occlusion": occlusion, "replace_occlusion": self.replace_occlusion}

    def _missed(self, baked: ao.Bake) -> list[str]:
        """A warning of the vertices that the cage missed, if there are any."""
        missed = baked.flagged["missed"]
        text = "vertices are not within the cage of the fine mesh and take the closest point of it"
        return [f"{self.output}: {missed:,} {text}"] if missed else []

    def _write(self, baked: ao.Bake, source: MeshFile, falloff: ao.Falloff) -> tuple[str, list[str]]:
        """Write the output: what to add to the summary, and warnings. Args: falloff: of textures."""
        from ..writers.write import write

        write(self.output, baked, source, **self._channels())
        return "", self._coarse(baked)

    def _coarse(self, baked: ao.Bake) -> list[str]:
        """A warning that w between the vertices is not what is interpolated, if that shows."""
        if not baked.coarse or baked.interpolation is None:
            return []
        fit = "" if self.method == "surface" else "--method surface, "
        instead = f"--occlusion texture for a .glb, -o NAME.png, {fit}or smaller faces"
        text = f"between the vertices w errs by {baked.interpolation.rmse:.2f}, the faces are too large for it"
        return [f"{self.output}: {text}: {instead}"]

    def _write_report(
        self, path: Path, baked: ao.Bake, made: tuple[list[dict[str, Any]], dict[str, float], list[str]]
    ) -> None:
        """Args: made: what was read, the seconds it took, and warnings."""
        from ao.report import report

        from ..report.complete import complete, write_report

        def pictures() -> list[list[Picture]]:
            from ..report.pictures import pictures_of_vertices

            return [pictures_of_vertices(baked.mesh, baked.w, baked.error)]

        inputs, seconds, warnings = made
        options = self.described()
        whole = complete("bake", "mesh", report(baked, options, seconds, warnings), inputs, options)
        write_report(path, whole, pictures)


def _ending(path: Path | None) -> str:
    return path.suffix.lower() if path else ""
