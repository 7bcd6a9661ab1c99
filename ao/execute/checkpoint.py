"""Checkpoints of long bakes: traced rows go to a journal, from which a later run takes them."""

import hashlib
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from raytrace.errors import InputError, OutputError
from raytrace.mesh.placement import Placement
from raytrace.system.atomic import PathName
from raytrace.types import Bools, Float64s

from ..points.receivers import Receivers
from ..rays.ray_scene import RayScene
from .journal import IDENTITY, Block, Journal, record
from .work import Advance, FillSpans, KeptRowTask, Outputs, RowTask, bit_environment, fill_spans


class Checkpoint:
    """Where the rows of one bake are kept, for `ao.bake` in a `with` block that also writes what was baked: a journal.

    Rows depend only on what their call is named by and on the header's hash, so copied ones are the bits that tracing
    would give. After a minute of work, what is in the file counts; before, it takes what would fill the memory. It is
    deleted when the block ends well, and kept when it does not.

    Args:
        path: the journal, best beside the target; None keeps nothing. resume: continue what it holds.
        notify: called with a line for the user. after, every: seconds until what is kept is safe, and from then on.
        fill_spans: makes the rows that are not kept. status: what to show beside the progress of that.
        most_waiting: bytes that are kept in memory.

    Attributes: partial: whether it fills only some rows, so that later rays must not depend on what earlier ones found.

    Raises, on entry into the bake:
        InputError: `resume`, and the journal is of another mesh, other options, another version or processor.
        OutputError: another process is at work on it, or it is some other file.
    """

    partial = False
    _expected = "the journal of this very bake"

    def __init__(
        self,
        path: PathName | None,
        resume: bool = False,
        notify: Callable[[str], object] = warnings.warn,
        after: float = 60.0,
        every: float = 5.0,
        fill_spans: FillSpans = fill_spans,
        status: Callable[[], str] = str,
        most_waiting: int = 1 << 25,
    ) -> None:
        self.path, self.resume, self.notify, self.after, self.every = Path(path or ""), resume, notify, after, every
        self.fill_spans, self.status, self.most_waiting = fill_spans, status, most_waiting
        self._journal: Journal | None = None
        self._identity: Callable[[], bytes] = bytes  # computed where a journal is there, or begun
        self._left_over = False
        self._given_up = path is None
        self._pending: list[bytes] = []
        self._due = time.monotonic() + after

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if kind is None:
            if self._journal is None and self._left_over:
                with suppress(OSError):
                    self._journal = Journal(self.path, create=False)
            if self._journal:
                self._journal.remove()
            return
        if self._journal or time.monotonic() >= self._due:
            self._write()
        if self._journal:
            self.notify(f"{self.path} keeps the finished part; the same command with --resume continues from it")
            self._journal.close()

    def begin(self, placement: Placement, receivers: Receivers, *settings: object) -> None:
        """Open the journal and continue from it, if there is one of this bake.

        Args: everything that decides rows; `settings` by their repr.
        """
        if self._given_up:
            return
        self._identity = cache(lambda: identity(placement, receivers, settings))
        self._due = time.monotonic() + self.after
        try:
            journal = Journal(self.path, create=False)
        except FileNotFoundError:
            journal = None
        except OSError as reason:
            if isinstance(reason, OutputError) or self.resume:
                raise _output_error(self.path, reason) from None
            return
        is_ours = bool(journal and journal.identity and journal.identity == self._identity())
        if is_ours and self.resume:
            self._journal, self._due = journal, time.monotonic() + self.every
            return
        if journal:
            journal.close()
        if self.resume:
            if journal and journal.identity:
                raise InputError(self.path, "header", self._expected, "that of another or of a change")
            self.notify(f"{self.path}: nothing to resume; starting from the beginning")
        self._left_over = journal is not None
        if is_ours:
            self.notify(f"{self.path}: left by an interrupted run; --resume would continue it; starting over")

    def fill(self, work: KeptRowTask, scene: RayScene, threads: int, advance: Advance) -> Outputs:
        """All rows of `work`: those that are kept, and the others made. Args: advance: called with numbers of rows."""
        name, tables = work.name, work.tables()
        to_make = self.choose(work, ~self.restored(work, tables))

        def finished(start: int, stop: int) -> None:
            if not self._given_up:
                self.put((name, start, stop), b"".join(table[start:stop].tobytes() for table in tables))
            advance(stop - start)

        if done := len(work) - int(np.count_nonzero(to_make)):
            advance(done)
        if to_make.any():
            edges = np.flatnonzero(np.diff(to_make, prepend=False, append=False)).tolist()
            spans = list(zip(edges[::2], edges[1::2], strict=True))
            self.fill_spans(work, scene, spans, tables, threads, finished)
        return tables

    def choose(self, work: RowTask, missing: Bools) -> Bools:
        """The rows of `missing`, bool (k,), that this process is to make: here all, in a part its share."""
        return missing

    def restored(self, work: KeptRowTask, tables: Outputs) -> Bools:
        """Copy recorded rows of the work into `tables`; returns which rows (k,) these are."""
        is_kept = np.zeros(len(work), np.bool_)
        if self._journal:
            name = work.name
            for block in self._journal.blocks:
                if block[0] == name:
                    restore(block, self._journal.content(block), work, tables, is_kept)
        return is_kept

    def all_traced(self) -> None:
        """Called when no more rows will be asked for."""

    def cached(self, name: str, compute: Callable[[], Float64s]) -> Float64s:
        """The result (k,) of `compute`, recorded under a name, so that a continued run does not compute it again."""
        block = hashlib.blake2b(name.encode(), digest_size=16).digest(), 0, 0
        if self._journal and block in self._journal.blocks:
            return np.frombuffer(self._journal.content(block))
        values = compute()
        if not self._given_up:
            self.put(block, values.tobytes())
        return values

    def put(self, block: Block, content: bytes) -> None:
        """Record a block; it is written after some time, or with many others."""
        self._pending.append(record(block, content))
        if time.monotonic() >= self._due:
            self._write()
            self._due = time.monotonic() + self.every
        elif sum(map(len, self._pending)) >= self.most_waiting:
            self._write(safe=False)

    def _write(self, safe: bool = True) -> None:
        """Write the pending records; if `safe`, sign the journal, so that they count whatever happens."""
        if self._given_up or not (self._pending or self._journal):
            return
        try:
            if self._journal is None:
                self._journal = Journal(self.path, create=True)
                self._journal.start()
            self._journal.append(*self._pending)
            self._pending.clear()
            if safe:
                self._journal.sign(self._identity())
        except OSError as reason:
            self._give_up(_output_error(self.path, reason))

    def _give_up(self, reason: OutputError) -> None:
        """Go on without a journal that cannot be written."""
        self._given_up = True
        self._pending.clear()
        self.notify(f"{reason}; going on without checkpoints")


NOTHING_KEPT = Checkpoint(None)


def identity(placement: Placement, receivers: Receivers, settings: tuple[object, ...]) -> bytes:
    """Hash of all that decides a bake's rows, 32 bytes."""
    digest = hashlib.blake2b(repr((bit_environment(), placement.scale, placement.diagonal, settings)).encode())
    arrays: list[npt.NDArray[Any]] = [placement.vertices, receivers.faces]
    for points in (receivers.points, receivers.corners.points):
        arrays += [points.origins, points.normals, points.numbers]
    arrays += map(np.asarray, receivers.opacity or ())
    for array in arrays:
        digest.update(repr((array.shape, array.dtype)).encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.digest()[:IDENTITY]


def restore(block: Block, content: bytes, work: KeptRowTask, tables: Outputs, restored: Bools) -> None:
    """Copy recorded rows into `tables` and mark them in `restored` (k,), if `work` could make such rows."""
    _, start, stop = block
    row_count = stop - start
    if not 0 <= start < stop <= len(restored) or len(content) != sum(table[:1].nbytes for table in tables) * row_count:
        return
    begin = 0
    stored = []
    for table in tables:
        size = table[start:stop].size
        stored.append(np.frombuffer(content, table.dtype, size, begin).reshape(row_count, *table.shape[1:]))
        begin += stored[-1].nbytes
    if work.could_make(tuple(stored)):
        for table, values in zip(tables, stored, strict=True):
            table[start:stop] = values
        restored[start:stop] = True


def _output_error(path: Path, reason: OSError) -> OutputError:
    """An error of the system as one of the journal's file."""
    return reason if isinstance(reason, OutputError) else OutputError(f"{path}: {reason.strerror or reason}")
