"""`obscurance bake` of several inputs: small meshes side by side on the cores, large ones by all of them in turn.

With `--cluster` small meshes are read, baked and written by the workers of a Dask cluster.
"""

from __future__ import annotations

import errno
import json
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from obscurance.raytrace.errors import printable
from obscurance.raytrace.system.checks import check_outputs, check_regular
from obscurance.raytrace.system.threads import run_blocks, thread_count

from ..show.progress import progress
from .console import note, unprinted_warnings, warn
from .inputs import created_folders
from .manifest import MANIFEST, Entry, Manifest, digest
from .plan import Plan
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
