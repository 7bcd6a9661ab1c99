"""`obscurance bake` of several inputs: small meshes side by side on the cores, large ones by all of them in turn."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raytrace.errors import printable
from raytrace.system.checks import check_outputs, check_regular
from raytrace.system.threads import run_blocks, thread_count

from .bake import MeshBake, Outcome, bake_one, silence_tolerance_warnings
from .console import note, progress, warn
from .inputs import MANIFEST, made
from .manifest import Entry, Manifest, assign_shards, digest, part_manifest
from .remote import Workers, bake_remotely, cluster_checkpoint

if TYPE_CHECKING:
    import ao
    from ao.cluster.session import ClusterSession

_LARGE = 1 << 21  # bytes of a mesh file from which on a bake keeps all cores busy by itself
_OF_ONE = ("mesh", "output", "threads")  # options that differ from one bake to another, or change no result


@dataclass(frozen=True)
class Batch:
    """Bakes with the same options, one for each input."""

    bakes: Sequence[MeshBake]
    folder: Path  # of their outputs
    workers: Workers | None = None  # of a cluster, to trace the rays
    part: tuple[int, int] | None = None  # (K, N), to bake only the K-th of N parts

    def run(self) -> int:
        """Bake all, going on after faults, each reported in one line. Returns: the exit status, 1 for faults."""
        if self.workers:
            self.check(keep=False)  # before any are asked for
        start = time.perf_counter()
        with self.workers.session(self.folder / MANIFEST) if self.workers else nullcontext() as session:
            falloff, manifest = self.check(), self._manifest()
            try:
                with silence_tolerance_warnings():
                    self._bake_all(manifest, falloff, session)
            except KeyboardInterrupt:
                note(f"interrupted: {self._summary(manifest)}; the same command with --resume bakes the others")
                raise SystemExit(130) from None
            finally:
                manifest.write()
        if not self.bakes[0].quiet:
            print(f"{self._summary(manifest)} in {time.perf_counter() - start:.2f} s; {printable(str(manifest.path))}")
            if session:
                print(session.summary())
        return 1 if manifest.count("failed") else 0

    def check(self, keep: bool = True) -> ao.Falloff:
        """`MeshBake.check` of all, in folders that are made, and stay if `keep`."""
        with made((self.folder, *(bake.output.parent for bake in self.bakes)), keep):
            falloff = self.bakes[0].check()
            inputs = [path for bake in self.bakes for path in bake.inputs()]
            written: dict[str, Path | None] = {f"output {bake.output}": bake.output for bake in self.bakes}
            check_outputs({**written, "manifest": self.manifest}, inputs)
        return falloff

    @property
    def manifest(self) -> Path:
        return self.folder / (part_manifest(*self.part) if self.part else MANIFEST)

    def _summary(self, manifest: Manifest) -> str:
        failed = manifest.count("failed")
        text = f"{manifest.count('done'):,} of {len(manifest.entries):,} meshes baked to {printable(str(self.folder))}"
        return text + (f", {failed:,} failed" if failed else "")

    def _manifest(self) -> Manifest:
        from ao.report import versions

        options = {name: value for name, value in self.bakes[0].described().items() if name not in _OF_ONE}
        facts: dict[str, Any] = {"options": options, "versions": versions()}
        if self.part:
            facts["part"] = {"number": self.part[0], "of": self.part[1], "inputs": [str(b.mesh) for b in self.bakes]}
        entries = [Entry(str(b.mesh), str(b.output), sha256=digest(_read_by(b))) for b in self._own()]
        manifest = Manifest(self.manifest, entries, facts)
        if self.bakes[0].resume or (self.part and self.manifest.exists()):
            manifest.resume(note)
        return manifest

    def _own(self) -> list[MeshBake]:
        """The bakes to be done here: all, or this shard's."""
        if not self.part:
            return list(self.bakes)
        shards = assign_shards([_identity(bake.mesh)[0] for bake in self.bakes], self.part[1])
        return [bake for bake, shard in zip(self.bakes, shards, strict=True) if shard == self.part[0]]

    def _bake_all(self, manifest: Manifest, falloff: ao.Falloff, session: ClusterSession | None) -> None:
        bakes, first = self._own(), self.bakes[0]
        places = [place for place, entry in enumerate(manifest.entries) if entry.status == "waiting"]
        threads, done = thread_count(first.threads), len(bakes) - len(places)
        vertices = [place for place in places if bakes[place].sort == "vertices"]
        small = [place for place in vertices if _identity(bakes[place].mesh)[0] < _LARGE]
        status = session.status if session else str
        with progress(first.quiet, "meshes", form=first.progress, status=status) as (advance,):

            def add(more: int) -> None:
                nonlocal done
                done += more
                if advance:
                    advance(done, len(bakes))
                manifest.save()

            def bake_here(place: int, threads: int) -> None:
                entry, bake = manifest.entries[place], bakes[place]
                before = _identity(bake.output)
                if session:
                    bake = bake.replaced(open_checkpoint=partial(cluster_checkpoint, session, first.resume))
                try:
                    _note(entry, bake_one(bake, falloff, threads, first.resume))
                except KeyboardInterrupt:
                    if _identity(bake.output) != before:  # it has been written, whole
                        entry.done()
                    raise

            def bake_small(start: int, stop: int) -> None:
                for place in small[start:stop]:
                    bake_here(place, 1)

            if session:
                given = [bakes[place] for place in small]
                for place, outcome in bake_remotely(session, given, falloff, first.resume, threads):
                    warn([], outcome.warnings)
                    _note(manifest.entries[small[place]], outcome)
                    add(1)
            else:
                run_blocks(len(small), 1, bake_small, threads, add)
            for place in sorted({*places} - {*small}):
                bake_here(place, threads)
                add(1)


def _note(entry: Entry, outcome: Outcome) -> None:
    """Take over what became of an input."""
    vars(entry).update(vars(outcome))
    if outcome.status == "failed":
        note(outcome.message)
    else:
        entry.done()


def _read_by(bake: MeshBake) -> list[Path]:
    """The files that a bake reads: in its options, and files that a .gltf or .obj names."""
    from ..formats.gltf.asset import Gltf  # slow imports
    from ..formats.obj.mtl import named_files

    files = bake.inputs()
    for path in [*files]:
        with suppress(OSError, ValueError, TypeError, AttributeError, RecursionError):  # its bake will say why
            check_regular(path, "a file")
            if path.suffix.lower() == ".gltf":
                files += Gltf(path, json.loads(path.read_bytes())).files[1:]
            elif path.suffix.lower() == ".obj":
                files += named_files(path)
    return files


def _identity(path: Path) -> tuple[int, ...]:
    """A file's bytes, and what changes if it is replaced."""
    try:
        status = path.stat()
        return status.st_size, status.st_ino, status.st_mtime_ns
    except (OSError, ValueError):
        return 0, 0, 0
