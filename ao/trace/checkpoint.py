"""Checkpoints of long bakes: traced blocks go to a journal, from which a later run copies them."""

from __future__ import annotations

import hashlib
import os
import threading
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import llvmlite.binding
import numpy as np
import numpy.typing as npt

from raytrace.embree import library as embree
from raytrace.errors import InputError, OutputError
from raytrace.kernel.cache import source_hash
from raytrace.mesh.placement import Placement
from raytrace.types import AnyInts, Float64s

from ..gather.receivers import Receivers
from .journal import Journal, record

AFTER = 60.0  # seconds of work until a journal is begun
EVERY = 5.0  # seconds between writes
_MOST_WAITING = 1 << 26  # bytes that are written at once, due or not


class Checkpoint:
    """The journal of one bake, for `ao.bake` in a `with` block that also writes what was baked.

    Rows depend only on what their call is named by and on the header's hash, so copied ones are the bits that tracing
    would give. The file appears after a minute of work, or when much waits to be written. It is deleted when the block
    ends well, and kept when it does not.

    Args:
        path: the journal, best beside the target. resume: continue what it holds.
        tell: called with a line for the user. after, every: seconds until the first write and between writes.

    Raises, on entry into the bake:
        InputError: `resume`, and the journal is of another mesh, other options, another version or processor.
        OutputError: another process is at work on it, or it is some other file.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        resume: bool = False,
        tell: Callable[[str], object] = warnings.warn,
        after: float = AFTER,
        every: float = EVERY,
    ) -> None:
        self.path, self.resume, self.tell, self.after, self.every = Path(path), resume, tell, after, every
        self._journal: Journal | None = None
        self._identity = b""
        self._left_over = False
        self._given_up = False
        self._pending: list[bytes] = []
        self._lock = threading.Lock()
        self._due = time.monotonic() + after

    def __enter__(self) -> Checkpoint:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        if kind is None:
            self._remove()
            return
        if self._journal or time.monotonic() >= self._due:
            self._write()
        if self._journal:
            self.tell(f"{self.path} keeps the finished part; the same command with --resume continues from it")
            self._journal.close()

    def begin(self, placement: Placement, receivers: Receivers, *settings: object) -> None:
        """Open what there is to continue. Args: everything that decides rows; `settings` by their repr."""
        versions = source_hash(), embree.version(), np.__version__, llvmlite.binding.get_host_cpu_name()
        digest = hashlib.blake2b(repr((versions, placement.scale, placement.diagonal, settings)).encode())
        arrays: list[npt.NDArray[Any]] = [placement.vertices, receivers.faces]
        for points in (receivers.points, receivers.corners.places):
            arrays += [points.origins, points.normals, points.numbers]
        for array in arrays:
            digest.update(repr((array.shape, array.dtype)).encode())
            digest.update(np.ascontiguousarray(array).data)
        self._identity = digest.digest()[:32]
        self._due = time.monotonic() + self.after
        try:
            found = Journal(self.path, create=False)
        except FileNotFoundError:
            found = None
        except OSError as reason:
            if isinstance(reason, OutputError) or self.resume:
                raise _refused(self.path, reason) from None
            return
        if found and self.resume and found.identity == self._identity:
            self._journal, self._due = found, time.monotonic() + self.every
            return
        if found:
            found.close()
        if self.resume:
            if found and found.identity:
                raise InputError(self.path, "header", "the journal of this very bake", "that of another or of a change")
            self.tell(f"{self.path}: nothing to resume; starting from the beginning")
        self._left_over = found is not None
        if found and found.identity == self._identity:
            self.tell(f"{self.path}: left by an interrupted run; --resume would continue it; starting over")

    def call(self, numbers: AnyInts, samples: int, key: np.uint32) -> bytes:
        """Name of the rays of `samples` directions, drawn by `key`, at the points of these numbers: 16 bytes."""
        digest = hashlib.blake2b(repr((samples, int(key))).encode(), digest_size=16)
        digest.update(np.ascontiguousarray(numbers).data)
        return digest.digest()

    def copy(self, call: bytes, first: int, *tables: npt.NDArray[Any]) -> bool:
        """Fill the rows of a call, from number `first` on, if the journal has them; from any thread.

        Args: tables: one or more, contiguous, (k, …): columns of the same k rows.
        """
        block = call, first, first + len(tables[0])
        with self._lock:
            if self._journal is None or block not in self._journal.blocks:
                return False
            content = self._journal.content(block)
        begin = 0
        for table in tables:
            table[:] = np.frombuffer(content, table.dtype, table.size, begin).reshape(table.shape)
            begin += table.nbytes
        return True

    def add(self, call: bytes, first: int, *tables: npt.NDArray[Any]) -> None:
        """Take note of traced rows, see `copy`; from any thread."""
        if not self._given_up:
            content = b"".join(table.tobytes() for table in tables)
            self._pending.append(record((call, first, first + len(tables[0])), content))

    def once(self, name: str, compute: Callable[[], Float64s]) -> Float64s:
        """What `compute` returns, (k,), unless the journal has it; from the thread that writes."""
        block = hashlib.blake2b(name.encode(), digest_size=16).digest(), 0, 0
        if self._journal and block in self._journal.blocks:
            return np.frombuffer(self._journal.content(block))
        values = compute()
        if not self._given_up:
            self._pending.append(record(block, values.tobytes()))
            self.save()
        return values

    def save(self) -> None:
        """Write what was added if it is time to, or if much was."""
        if self._given_up:
            return
        if time.monotonic() >= self._due or sum(map(len, self._pending)) >= _MOST_WAITING:
            self._write()
            self._due = time.monotonic() + self.every

    def _write(self) -> None:
        count = len(self._pending)
        if self._given_up or not count:
            return
        try:
            with self._lock:
                if self._journal is None:
                    self._journal = Journal(self.path, create=True)
                    self._journal.start(self._identity)
                self._journal.append(b"".join(self._pending[:count]))
            del self._pending[:count]
        except OSError as reason:
            self._given_up = True
            self._pending.clear()
            self.tell(f"{_refused(self.path, reason)}; going on without checkpoints")

    def _remove(self) -> None:
        if self._journal is None and self._left_over:
            with suppress(OSError):
                self._journal = Journal(self.path, create=False)
        if self._journal:
            self._journal.remove()


def _refused(path: Path, reason: OSError) -> OutputError:
    return reason if isinstance(reason, OutputError) else OutputError(f"{path}: {reason.strerror or reason}")
