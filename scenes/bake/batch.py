"""`obscurance bake` of several inputs: small meshes side by side on the cores, large ones by all of them in turn.

With `--cluster` small meshes are read, baked and written by the workers of a Dask cluster.
"""

from __future__ import annotations

import errno
import glob
import json
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, get_args

from obscurance.raytrace.errors import ConflictError, OptionError, printable
from obscurance.raytrace.system.checks import check_outputs, check_regular, make_folder
from obscurance.raytrace.system.threads import run_blocks, thread_count

from ..formats.load import STANDARD
from ..formats.table import endings
from ..show.progress import progress
from .console import note, unprinted_warnings, warn
from .inputs import is_pattern
from .manifest import MANIFEST, Entry, Manifest, digest
from .options import BakeOptions, Format
from .plan import Plan, in_mesh_units, plan_bake, preset_format
from .run import Outcome, kept_by, run_in_batch, silence_tolerance_warnings, workers_of

if TYPE_CHECKING:
    from obscurance.ao.cluster.workers import SharedScene, Workers

_LARGE = 1 << 21  # bytes of a mesh file from which on a bake keeps all cores busy by itself
_OF_ONE = ("mesh", "output", "threads")  # options that differ from one bake to another, or change no result


@dataclass(frozen=True)
class Batch:
    """Plans with the same options, one for each input.

    Attributes: folder: of the outputs.
    """

    plans: Sequence[Plan]
    folder: Path

    @classmethod
    def of(cls, options: BakeOptions) -> Self:
        """The batch that the options ask for.

        Raises: OptionError: a file's name for the folder, no inputs, or several that would have one output.
        """
        folder = options.output_dir
        if STANDARD in options.mesh:
            raise ConflictError("output_dir", "does not go with", "-, standard input")
        if folder.suffix.lower().removeprefix(".") in get_args(Format) and not os.path.exists(folder):
            raise OptionError("output_dir", "a folder", f"{folder}, the name of a file", nearest="--output")
        inputs = expand(options.mesh)
        outputs = outputs_in(folder, inputs, preset_format(options))
        first, *others = (in_mesh_units(options, mesh) for mesh in inputs)
        for mesh, scaled in zip(inputs[1:], others, strict=True):
            if vars(scaled) != vars(first):
                raise OptionError("mesh", f"files in the unit of {inputs[0]}, as a length has a unit", mesh)
        plan = plan_bake(options.replaced(mesh=inputs[:1], output=outputs[0]))
        plans = [plan.with_options(mesh=[mesh], output=output) for mesh, output in zip(inputs, outputs, strict=True)]
        return cls(plans, folder)

    def run(self) -> int:
        """Bake all, going on after faults, each reported in one line. Returns: the exit status, 1 for faults."""
        if self.plans[0].options.cluster:
            self.check_files(keep=False)  # before any are asked for
        start = time.perf_counter()
        with workers_of(self.plans[0].options) as workers:
            self.check_files()
            manifest = self._begin()
            try:
                with silence_tolerance_warnings():
                    self._bake_all(manifest, workers)
            except KeyboardInterrupt:
                note(f"interrupted: {self._summary(manifest)}; the same command with --resume bakes the others")
                raise SystemExit(130) from None
            finally:
                manifest.write()
        if not self.plans[0].options.quiet:
            print(f"{self._summary(manifest)} in {time.perf_counter() - start:.2f} s; {printable(str(manifest.path))}")
            if workers:
                print(workers.summary())
        return 1 if manifest.count("failed") else 0

    def check_files(self, keep: bool = True) -> None:
        """`Plan.check_files` of all plans. Folders of outputs are made for that, and stay if `keep`."""
        with created_folders((self.folder, *(plan.output.parent for plan in self.plans)), keep):
            self.plans[0].check_files()
            inputs = [path for plan in self.plans for path in plan.inputs]
            outputs = {f"output {plan.output}": plan.output for plan in self.plans}
            check_outputs({**outputs, "manifest": self.manifest}, inputs)

    @property
    def manifest(self) -> Path:
        return self.folder / MANIFEST

    def _summary(self, manifest: Manifest) -> str:
        """The line after a batch: how many meshes are done, and have failed."""
        failed = manifest.count("failed")
        text = f"{manifest.count('done'):,} of {len(manifest.entries):,} meshes baked to {printable(str(self.folder))}"
        return text + (f", {failed:,} failed" if failed else "")

    def _begin(self) -> Manifest:
        """The manifest, with what is done if the batch is resumed."""
        from obscurance.ao.report import versions

        options = {name: value for name, value in self.plans[0].described().items() if name not in _OF_ONE}
        facts: dict[str, Any] = {"options": options, "versions": versions()}
        entries = [Entry(str(plan.mesh), str(plan.output), sha256=digest(_files_of(plan))) for plan in self.plans]
        manifest = Manifest(self.manifest, entries, facts)
        if self.plans[0].options.resume:
            manifest.resume(note)
        return manifest

    def _bake_all(self, manifest: Manifest, workers: Workers | None) -> None:
        """Bake what the manifest has waiting: by workers, or small meshes on a thread each and large ones on all
        threads."""
        plans = self.plans
        options = plans[0].options
        waiting = [number for number, entry in enumerate(manifest.entries) if entry.status == "waiting"]
        threads = thread_count(options.threads)
        done = len(plans) - len(waiting)
        in_vertices = [number for number in waiting if plans[number].kind == "vertices"]
        small = [number for number in in_vertices if _identity(plans[number].mesh)[0] < _LARGE]
        status = workers.status if workers else str
        with progress(options.quiet, "meshes", form=options.progress, status=status) as (advance,):

            def add(finished: int) -> None:
                nonlocal done
                done += finished
                if advance:
                    advance(done, len(plans))
                manifest.save()

            def bake_here(number: int, threads: int) -> None:
                """Bake one input, and note its outcome; Ctrl-C leaves a whole output noted as done."""
                entry = manifest.entries[number]
                plan = plans[number]
                before = _identity(plan.output)
                try:
                    _note(entry, run_in_batch(plan, threads, partial(kept_by, workers)))
                except KeyboardInterrupt:
                    if _identity(plan.output) != before:  # it has been written, whole
                        entry.done()
                    raise

            def bake_small(start: int, stop: int) -> None:
                for number in small[start:stop]:
                    bake_here(number, 1)

            # Small meshes side by side, then the others one by one, on all threads or by workers.
            if workers:
                for row, outcome in run_remotely(workers, [plans[number] for number in small]):
                    warn([], outcome.warnings)
                    _note(manifest.entries[small[row]], outcome)
                    add(1)
            else:
                run_blocks(len(small), 1, bake_small, threads, add)
            for number in sorted({*waiting} - {*small}):
                bake_here(number, threads)
                add(1)


def expand(given: Iterable[Path]) -> list[Path]:
    """The files that names and patterns of `glob` stand for, each once.

    Raises: OptionError: a folder, or a pattern that matches nothing.
    """
    paths: dict[str, Path] = {}
    for path in given:
        if os.path.isdir(path):
            raise OptionError("mesh", "mesh files", f"{path}, a folder", nearest=_pattern_in(path))
        matches = [path]
        if is_pattern(path):
            names = sorted(glob.glob(str(path), recursive=True))
            matches = [Path(name) for name in names if os.path.isfile(name)]
            if not matches:
                raise OptionError("mesh", "a pattern that matches files", f"{path}, which matches none")
        for name in matches:
            paths.setdefault(os.path.realpath(name), name)
    return list(paths.values())


def _pattern_in(folder: Path) -> str | None:
    """A pattern of the mesh files in a folder, in quotes as a shell takes it."""
    in_folder = [entry.suffix.lower() for entry in folder.iterdir()]
    most = max(endings("read"), key=in_folder.count)
    return f"'{folder / '*'}{most}'" if most in in_folder else None


def outputs_in(folder: Path, inputs: Sequence[Path], ending: str) -> list[Path]:
    """An output for each input: its name, with another ending, in `folder`.

    Where names are equal the outputs lie below `folder` as the inputs do below the folder that holds them all.
    """
    names = [Path(f"{path.stem}.{ending}") for path in inputs]
    if len({os.path.normcase(name) for name in names}) < len(names):
        folders = [os.path.abspath(path.parent) for path in inputs]
        with suppress(ValueError):  # they are on several drives
            top = os.path.commonpath(folders)
            names = [Path(os.path.relpath(path, top), name) for path, name in zip(folders, names, strict=True)]
    input_of: dict[str, Path] = {}
    for path, name in zip(inputs, names, strict=True):
        other = input_of.setdefault(os.path.normcase(name), path)
        if other is not path:
            expected = "inputs of different names in each folder"
            raise OptionError("output_dir", expected, f"{other} and {path}, both for {folder / name}")
    return [folder / name for name in names]


@contextmanager
def created_folders(folders: Iterable[Path], keep: bool) -> Iterator[None]:
    """Make folders, unless they are there; they go if that or the block fails, or not `keep`. Raises: OutputError."""
    several = dict.fromkeys(folders)
    new = {path for folder in several for path in (folder, *folder.parents) if not os.path.exists(path)}
    passed = False
    try:
        for folder in several:
            make_folder(folder)
        yield
        passed = True
    finally:
        if not (passed and keep):
            for path in sorted(new, reverse=True):  # the deepest ones come before those that hold them
                with suppress(OSError):
                    path.rmdir()


def _note(entry: Entry, outcome: Outcome) -> None:
    """Record the outcome of an input in its entry."""
    vars(entry).update(outcome._asdict())
    if outcome.status == "failed":
        note(outcome.message)
    else:
        entry.done()


def _files_of(plan: Plan) -> list[Path]:
    """All files that a bake reads: named in its options, or by a .gltf or .obj."""
    from ..formats.gltf.asset import Gltf  # slow imports
    from ..formats.obj.mtl import named_files

    files = plan.inputs
    for path in [*files]:
        with suppress(OSError, ValueError, TypeError, AttributeError, RecursionError):  # its bake will say why
            check_regular(path, "a file")
            if path.suffix.lower() == ".gltf":
                files += Gltf(path, json.loads(path.read_bytes())).files
            elif path.suffix.lower() == ".obj":
                files += named_files(path)
    return files


def _identity(path: Path) -> tuple[int, ...]:
    """A file's size in bytes, and facts that change if it is replaced."""
    try:
        status = path.stat()
        return status.st_size, status.st_ino, status.st_mtime_ns
    except (OSError, ValueError):
        return 0, 0, 0


def run_remotely(workers: Workers, plans: Sequence[Plan]) -> Iterator[tuple[int, Outcome]]:
    """Bake by workers, which see all files under the same names: the row of each plan, and what became of it."""
    sizes = [plan.mesh.stat().st_size if plan.mesh.is_file() else 0 for plan in plans]
    rows = sorted(range(len(plans)), key=lambda row: -sizes[row])  # the largest come before, to end together
    for number, fields in workers.map(_bake, (), lambda number: plans[rows[number]].absolute(), len(plans)):
        yield rows[number], _named_as(plans[rows[number]], _outcome(fields))


def _bake(_: SharedScene, plan: Plan) -> tuple[object, ...]:
    """Bake one mesh on a worker. Raises: FileNotFoundError: a folder is not seen from here."""
    for folder in (plan.mesh.parent, plan.output.parent):
        if not folder.is_dir():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(folder))
    with unprinted_warnings(), silence_tolerance_warnings():
        return tuple(run_in_batch(plan, 1))


def _outcome(fields: Any) -> Outcome:
    """The `Outcome` of the fields that a worker sends, each checked for its type."""
    from obscurance.raytrace.system.records import Fault, read

    try:
        return read(Outcome, dict(zip(Outcome._fields, fields, strict=True)))
    except (Fault, TypeError, ValueError):
        return Outcome("failed", 0.0, "a worker's answer is no outcome of a bake", [])


def _named_as(plan: Plan, outcome: Outcome) -> Outcome:
    """The outcome, with files named in its message and warnings as the plan has them."""

    def given(text: str) -> str:
        """A text with the names of files as they were given, in place of absolute ones."""
        for path in (*plan.inputs, plan.output):
            text = text.replace(str(path.absolute()), str(path))
        return text

    return outcome._replace(message=given(outcome.message), warnings=[given(line) for line in outcome.warnings])
