"""The common part of bakes of a mesh file to vertices and to a texture, and one bake of a batch."""

from __future__ import annotations

import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple
from warnings import catch_warnings, simplefilter

import ao
from raytrace.errors import ClusterError, ConflictError, ObscuranceError, OptionError, printable
from raytrace.system.atomic import is_standard_output
from raytrace.system.checks import check_ending, check_outputs
from raytrace.system.threads import thread_count

from ..falloffs import make_falloff, table_of
from ..formats.load import MeshFile, load
from ..show.report.verdict import Pictures, hashed, write_report
from .console import note
from .inputs import Sources
from .options import BAKER, REPORTS, ROWS, Record, command_line, plain

if TYPE_CHECKING:
    from ao.execute.checkpoint import Checkpoint
    from ao.options import Options


@contextmanager
def silence_tolerance_warnings() -> Iterator[None]:
    """Silence Python's warnings about tolerances that are not met: commands print their own."""
    with catch_warnings():
        simplefilter("ignore", ao.ToleranceWarning)
        yield


class WorkSize(NamedTuple):
    """Points of a bake at most, their unit, and bytes at its peak."""

    points: int
    unit: str
    bytes: int


Written = tuple[str, list[str]]  # of an output: its summary, and warnings about it, which have been printed


class MeshBake(Record, ABC):
    """A bake of a mesh file, to vertices or a texture, with its options as attributes."""

    sort: str  # in the words of `Option.on`
    record: type[Options]
    content: bytes | None = None  # of the mesh, if it is no file's
    open_checkpoint: Callable[[Path], AbstractContextManager[Checkpoint]] | None = None  # unless it is the usual one

    def run(self) -> int:
        """Bake, write, and print a summary. Returns: the exit status, 0. Raises: as `check`, `ao.bake` and writers."""
        falloff = self.check()
        with silence_tolerance_warnings():
            for summary, _ in self.bake(falloff):
                if not self.quiet:
                    print(summary, file=sys.stderr if is_standard_output(self.output) else sys.stdout)
        return 0

    def check(self) -> ao.Falloff:
        """The falloff, if the options go together and the outputs can be written. Raises: OptionError, OutputError."""
        from ao.falloff import resolve_length

        falloff = make_falloff(self.falloff, self.tau, self.half_distance, self.max_distance)
        self.checked()
        if isinstance(self.cage, str) and resolve_length("cage", self.cage, 1.0) == float("inf"):
            raise OptionError("cage", "a finite length", self.cage)
        self.ground_height()
        self.check_own()
        if self.report:
            check_ending("--report", self.report, *REPORTS)
        check_outputs(self.outputs(), self.inputs())
        return falloff

    def checked(self) -> Options:
        """The options that `ao.bake` or `ao.bake_texture` has. Raises: OptionError."""
        return self.record(**self.arguments())

    def arguments(self, sort: str | None = None) -> dict[str, Any]:
        """The options but files that are given and that `ao.bake` or `ao.bake_texture` has, for a bake of `sort`."""
        values = {row.name: getattr(self, row.name) for row in BAKER.values() if (sort or self.sort) in row.on.split()}
        return {name: value for name, value in values.items() if not isinstance(value, Path | None)}

    def described(self) -> dict[str, Any]:
        """Every effective option, as a JSON report has it."""
        rows = [row for row in ROWS.values() if row.role != "run" and self.sort in row.on.split()]
        return {row.name: plain(getattr(self, row.name)) for row in rows} | {"threads": thread_count(self.threads)}

    def hashed(self, files: Iterable[Path]) -> list[dict[str, Any]]:
        """Files that were read, as a report has them; nothing if there is none to write."""
        return hashed([*files, *table_of(self.falloff)], {self.mesh: self.content}) if self.report else []

    def write_report(self, report: Mapping[str, Any], inputs: list[dict[str, Any]], pictures: Pictures) -> None:
        options = self.described()
        line = command_line("bake", ROWS.values(), options)
        write_report(self.report, "bake", line, report, inputs, options, pictures)

    def checkpoint(self, output: Path) -> AbstractContextManager[Checkpoint]:
        """Keeps what is traced for an output, beside it; none beside standard output."""
        from ao.execute.checkpoint import Checkpoint

        if self.open_checkpoint:
            return self.open_checkpoint(output)
        return Checkpoint(None if is_standard_output(output) else journal(output), self.resume, note)

    def inputs(self) -> list[Path]:
        """The files that are read, as far as the options name them."""
        cage = [self.cage] if isinstance(self.cage, Path) else []
        return [self.mesh, *(self.high or ()), *cage, *(self.occluder or ()), *table_of(self.falloff)]

    @abstractmethod
    def outputs(self) -> dict[str, Path | None]:
        """The files to write, by what the user calls them."""

    @abstractmethod
    def check_own(self) -> None:
        """Check the options of this sort of bake. Raises: OptionError, OutputError."""

    def read(self) -> MeshFile:
        """The mesh file, with what the output can hold of it. Raises: InputError."""
        kept = Path("texture.glb") if self.sort == "texture" else self.output
        names = bool(self.receive or self.cast or self.exclude or self.match_names) or self.occluded_by != "all"
        return load(self.mesh, kept, self.content, self.alpha == "auto", self.up, names, self.flip)

    def check_up(self, picture: Path | None, *outputs: Path | None) -> None:
        """Raises: OptionError: `up`, and neither a picture nor an output that stands."""
        standing = (".html", ".ply", ".glb")
        endings = {path.suffix.lower() for path in (*outputs, self.report) if path}
        if self.up and not picture and not self.ground and endings.isdisjoint(standing):
            raise ConflictError("up", "needs", f"--ground, --debug-image or {', '.join(standing)}: else w is the same")

    def sources_of(self, source: MeshFile) -> Sources:
        """What is baked for `source`. Raises: InputError: of a file; OptionError: as `ground`, `select_objects`."""
        from ao.points.occluders import joined

        from ..formats.objects import match, select_objects

        names, given = self.match_names, (self.high, self.occluder)
        high, walls = ([load(path, alpha=self.alpha == "auto", names=names) for path in each or ()] for each in given)
        fine = joined([each.mesh for each in high], all_normals=True) if high else None
        cage = load(self.cage) if isinstance(self.cage, Path) else None
        by_name = self.receive or (), self.cast or (), self.exclude or ()
        chosen = select_objects(source, *by_name, self.occluded_by, self.output_dir is not None)
        ground = [ao.ground(chosen.mesh, self.ground_height())] if self.ground else []
        occluders = [*(each.mesh for each in walls), *ground]
        arguments = {"high": fine, "groups": match(source, high) if names else None, "occluders": occluders}
        arguments |= {"cage": cage.mesh} if cage else {}
        read = [source, *walls, *high, *([cage] if cage else [])]
        notes = [note for each in read for note in each.notes]
        for each in walls:
            size = each.mesh.radius / (source.mesh.radius or 1.0)
            if not 1e-3 < size < 1e3:
                notes.append(f"{each.mesh.source}: its radius is {size:.2g} of the mesh's: is its unit another?")
        files = [path for each in read for path in each.files]
        return Sources(source, chosen, fine, occluders, arguments, files, notes)

    def ground_height(self) -> float | None:
        """The height of the ground; None just below the mesh. Raises: OptionError: it is no number."""
        if self.ground in (None, "auto"):
            return None
        try:
            return float(self.ground)
        except ValueError:
            raise OptionError("ground", "auto, or a height in mesh units", repr(self.ground)) from None

    @abstractmethod
    def work(self, source: MeshFile, falloff: ao.Falloff) -> WorkSize:
        """The size of a bake of `source`. Raises: InputError: as `bake`, before anything is traced."""

    @abstractmethod
    def bake(self, falloff: ao.Falloff) -> Iterator[Written]:
        """Bake and write, one output after the other. Raises: as `run`."""


def journal(output: Path) -> Path:
    """The path of an output's journal."""
    return Path(f"{output}.partial")


@dataclass(frozen=True)
class Outcome:
    """Attributes: as of `scenes.jobs.manifest.Entry`."""

    status: Literal["done", "failed"]
    seconds: float
    message: str
    warnings: list[str] = field(default_factory=list)


def bake_one(bake: MeshBake, falloff: ao.Falloff, threads: int, resume: bool) -> Outcome:
    """Bake and write, or continue what was begun; errors become messages, but for a cluster's, which ends all bakes."""
    begun = resume and journal(bake.output).exists()
    bake = bake.replaced(quiet=True, progress="bar", threads=threads, resume=begun)
    start = time.perf_counter()
    try:
        written = list(bake.bake(falloff))
    except ClusterError:
        raise
    except Exception as fault:
        expected = isinstance(fault, ObscuranceError | OSError | MemoryError)
        message = str(fault) if expected and str(fault) else f"{type(fault).__name__}: {fault}"
        message = printable(message if str(bake.mesh) in message else f"{bake.mesh}: {message}")
        return Outcome("failed", round(time.perf_counter() - start, 3), message)
    message, warnings = "\n".join(text for text, _ in written), [line for _, lines in written for line in lines]
    return Outcome("done", round(time.perf_counter() - start, 3), message, warnings)
