"""`obscurance bake` of several inputs: small meshes side by side on the cores, large ones by all of them in turn."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from raytrace.errors import ObscuranceError, printable
from raytrace.system.threads import run_blocks, thread_count

from ..commands.bake import MeshBake, told_shortfalls
from ..commands.console import compiling, note, progress
from .inputs import MANIFEST, check_batch, made
from .manifest import Entry, Manifest

if TYPE_CHECKING:
    import ao

_LARGE = 1 << 21  # bytes of a mesh file from which on a bake keeps all cores busy by itself
_OF_ONE = ("mesh", "output", "threads")  # options that differ from one bake to another, or change no result


@dataclass(frozen=True)
class Batch:
    """Bakes with the same options.

    Attributes:
        bakes: one for each input. folder: of their outputs. resume: leave out what the manifest says is done.
        threads: how many in all. quiet: no progress bar and no summary.
    """

    bakes: Sequence[MeshBake]
    folder: Path
    resume: bool
    threads: int | None
    quiet: bool

    def run(self) -> int:
        """Bake all, going on after faults, each reported in one line. Returns: the exit status, 1 for faults.

        Raises:
            InputError: an option, or a manifest that cannot be resumed.
            OutputError: the folder, or an output in it, cannot be written.
            SystemExit: interrupted.
        """
        falloff = self.check()
        manifest = self._manifest()
        start = time.perf_counter()
        try:
            with compiling(self.bakes[0].kernels), told_shortfalls():
                self._bake_all(manifest, falloff)
        except KeyboardInterrupt:
            manifest.write()
            note(f"interrupted: {self._told(manifest)}; the same command with --resume bakes the others")
            raise SystemExit(130) from None
        manifest.write()
        if not self.quiet:
            print(f"{self._told(manifest)} in {time.perf_counter() - start:.2f} s; {printable(str(manifest.path))}")
        return 1 if manifest.count("failed") else 0

    def check(self, keep: bool = True) -> ao.Falloff:
        """The falloff, if the options go together and the outputs can be written; makes the folder of these.

        Args: keep: whether a folder that is made stays.

        Raises: OptionError, OutputError.
        """
        with made(self.folder, keep):
            falloff = self.bakes[0].check()
            inputs = [path for bake in self.bakes for path in bake.inputs()]
            check_batch(self.folder, inputs, [bake.output for bake in self.bakes])
        return falloff

    def _told(self, manifest: Manifest) -> str:
        failed = manifest.count("failed")
        text = f"{manifest.count('done'):,} of {len(self.bakes):,} meshes baked to {printable(str(self.folder))}"
        return text + (f", {failed:,} failed" if failed else "")

    def _manifest(self) -> Manifest:
        from ao.report import versions

        entries = [Entry(str(bake.mesh), str(bake.output), sha256=_digest(bake.mesh)) for bake in self.bakes]
        options = {name: value for name, value in self.bakes[0].described().items() if name not in _OF_ONE}
        manifest = Manifest(self.folder / MANIFEST, entries, {"options": options, "versions": versions()})
        if self.resume:
            manifest.resume(note)
        return manifest

    def _bake_all(self, manifest: Manifest, falloff: ao.Falloff) -> None:
        count = len(self.bakes)
        places = [place for place in range(count) if manifest.entries[place].status == "waiting"]
        threads = thread_count(self.threads)
        small = [place for place in places if self.bakes[place].side_by_side and _size(self.bakes[place].mesh) < _LARGE]
        large = sorted({*places} - {*small})
        done = count - len(places)
        with progress(self.quiet, "meshes", form=self.bakes[0].progress) as (advance,):

            def add(more: int) -> None:
                nonlocal done
                done += more
                if advance:
                    advance(done, count)
                manifest.save()

            def bake_small(start: int, stop: int) -> None:
                for place in small[start:stop]:
                    self._bake_one(manifest, place, falloff, 1)

            run_blocks(len(small), 1, bake_small, threads, add)
            for place in large:
                self._bake_one(manifest, place, falloff, threads)
                add(1)

    def _bake_one(self, manifest: Manifest, place: int, falloff: ao.Falloff, threads: int) -> None:
        bake, entry = self.bakes[place], manifest.entries[place]
        begun = self.resume and bake.journal(bake.output).exists()
        bake = replace(bake, quiet=True, progress="bar", threads=threads, resume=begun)
        start, before = time.perf_counter(), _identity(bake.output)
        try:
            written = list(bake.bake(falloff))
            entry.status = "done"
        except KeyboardInterrupt:
            if _identity(bake.output) != before:  # it has been written, whole
                entry.status = "done"
            raise
        except Exception as fault:
            expected = isinstance(fault, ObscuranceError | OSError | MemoryError)
            message = str(fault) if expected and str(fault) else f"{type(fault).__name__}: {fault}"
            entry.message = printable(message if entry.input in message else f"{entry.input}: {message}")
            entry.status = "failed"
            note(entry.message)
        else:
            entry.message = "\n".join(each.summary for each in written)
            entry.warnings = [line for each in written for line in each.warnings]
        entry.seconds = round(time.perf_counter() - start, 3)


def _digest(path: Path) -> str:
    """SHA-256 of a file's bytes in hex digits, nothing where it cannot be read: its bake will say why."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return ""


def _identity(path: Path) -> object:
    """What differs after a file is replaced."""
    try:
        found = path.stat()
        return found.st_ino, found.st_mtime_ns
    except (OSError, ValueError):
        return None


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except (OSError, ValueError):
        return 0
