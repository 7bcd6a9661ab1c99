"""Finished rows of a bake on disk, a file a block, from which the same bake goes on after an interrupt.

Rows depend on nothing but what their bake is named by, so that whoever makes a block makes the same bytes: no process
locks anything, and two of the same bake are two that write the same files.
"""

import hashlib
import os
import re
import stat
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

from obscurance.raytrace.errors import OutputError
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.system.atomic import PathName
from obscurance.raytrace.system.interrupts import at_once
from obscurance.raytrace.types import Float64s

from ..points.receivers import Receivers
from .work import Advance, KeptRowTask, Make, Outputs, Span, bit_environment, blocks, make_on_threads, packed, unpack

_CHECK = 16  # bytes of the checksum behind the rows of a block
_FILE = re.compile(r"[0-9a-f]{32}\.\d+|\.[0-9a-f]{16}")  # a block, or one that was being written
_READ = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)
_WRITE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)


class Kept:
    """Folders OUTPUT.partial-HASH, for a `with` block that also writes OUTPUT.

    HASH is of all that decides rows, so that another bake, or another page, has another folder. All are deleted when
    the block ends well, also those that other bakes to the same output have left, and stay when it does not.

    Args:
        output: the file to be written; None keeps nothing.
        notify: called with a line for the user.
        after: seconds whose rows are not kept, so that a short bake writes nothing.
        make: makes the rows that are not kept. status: what to show beside the progress of that.
    """

    def __init__(
        self,
        output: PathName | None,
        notify: Callable[[str], object] = warnings.warn,
        after: float = 10.0,
        make: Make = make_on_threads,
        status: Callable[[], str] = str,
    ) -> None:
        self.status = status
        self._output = None if output is None else Path(output)
        self._make = make
        self._notify = notify
        self._due = time.monotonic() + after
        self._folder: Callable[[], Path] = Path  # of the bake that is begun; hashing takes time
        self._found: list[Path] = []  # folders of these bakes that are there
        self._bytes = 0  # in them

    def __enter__(self) -> Self:
        at_once.append(self._tell)
        return self

    def __exit__(self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None) -> None:
        at_once.remove(self._tell)
        if kind is None:
            for folder in self._folders():
                _remove(folder)
        else:
            self._tell()

    def _tell(self) -> None:
        """Say where rows are kept, if any are."""
        if self._found:
            self._notify(f"{self._found[-1]} keeps the rows that are done: run the command again to go on from there")

    def begin(self, placement: Placement, receivers: Receivers, *settings: object) -> None:
        """Continue from the rows of this bake, if there are any. Args: all that decides rows; settings by `repr`."""
        self._folder = cache(lambda: Path(f"{self._output}.partial-{_identity(placement, receivers, settings)}"))
        if any(folder == self._folder() for folder in self._folders()):
            self._add_folder()
            self._due = time.monotonic()

    def fill(self, work: KeptRowTask, scene: Any, threads: int, advance: Advance) -> Outputs:
        """All rows of `work`: each block is taken, or made and kept. Args: advance: called with numbers of rows."""
        tables, name = work.tables(), work.name
        missing = []
        for start, stop in blocks(work):
            content = self._read(name, start)
            if content is not None and unpack(content, tables, (start, stop)):
                advance(stop - start)
            else:
                missing.append((start, stop))
        for span in self._make(work, scene, missing, tables, threads, advance):
            self._put(name, span, tables)
        return tables

    def cached(self, name: str, compute: Callable[[], Float64s]) -> Float64s:
        """The result (k,) of `compute`, kept under a name."""
        key = hashlib.blake2b(name.encode(), digest_size=16).digest()
        content = self._read(key, 0)
        if content is not None:
            return np.frombuffer(content)
        values = compute()
        self._put(key, (0, len(values)), (values,))
        return values

    def _folders(self) -> list[Path]:
        """The folders of this bake and of others to the same output."""
        if self._output is None:
            return []
        pattern = re.compile(re.escape(self._output.name) + r"\.partial-[0-9a-f]{16}")
        with suppress(OSError):
            names = filter(pattern.fullmatch, os.listdir(self._output.parent))
            return [folder for folder in map(self._output.with_name, names) if _is_own(folder)]
        return []

    def _add_folder(self) -> None:
        """Count this bake's folder among those that are there."""
        if self._folder() not in self._found:
            self._found.append(self._folder())
            with suppress(OSError):  # another process of this bake has ended
                self._bytes += sum(file.stat().st_size for file in os.scandir(self._folder()))

    def _read(self, name: bytes, start: int) -> memoryview | None:
        """The kept rows of a block; None if they are not there, or not whole."""
        if not self._found or self._found[-1] != self._folder():
            return None
        try:
            with os.fdopen(os.open(self._folder() / f"{name.hex()}.{start}", _READ), "rb") as file:
                content = memoryview(file.read())
        except OSError:
            return None
        rows, check = content[:-_CHECK], content[-_CHECK:]
        return rows if check == _checksum(name, start, rows) else None

    def _put(self, name: bytes, span: Span, tables: Outputs) -> None:
        """Keep the rows of a block, from some seconds on and until it cannot be done."""
        if self._output is None or time.monotonic() < self._due:
            return
        rows = packed(tables, span)
        try:
            self._write(f"{name.hex()}.{span[0]}", rows, _checksum(name, span[0], rows))
        except OSError as reason:
            self._due = float("inf")
            self._notify(f"{self._folder()}: {reason.strerror or reason}; going on without keeping rows")

    def _write(self, name: str, *parts: bytes) -> None:
        """Write a file beside its place, then rename it. Raises: OSError."""
        folder = self._folder()
        folder.mkdir(0o700, exist_ok=True)  # another process of this bake may have ended, and removed it
        if not _is_own(folder):
            raise OutputError("not a folder of this user")
        self._add_folder()
        size = sum(map(len, parts))
        from shutil import disk_usage  # which loads compressors; most bakes keep nothing

        if self._bytes + size > disk_usage(folder).free - size:
            raise OutputError("kept rows would take more than half of the free disk")
        temporary = folder / f".{os.urandom(8).hex()}"
        try:
            with os.fdopen(os.open(temporary, _WRITE, 0o600), "wb") as file:
                file.writelines(parts)
            os.replace(temporary, folder / name)
        finally:
            temporary.unlink(missing_ok=True)
        self._bytes += size


NOTHING_KEPT = Kept(None)


def _identity(placement: Placement, receivers: Receivers, settings: tuple[object, ...]) -> str:
    """Hash of all that decides a bake's rows, 16 hex digits."""
    digest = hashlib.blake2b(digest_size=8)
    digest.update(repr((bit_environment(), placement.scale, placement.diagonal, settings)).encode())
    arrays: list[npt.NDArray[Any]] = [placement.vertices, receivers.faces]
    for points in (receivers.points, receivers.corners.points):
        arrays += [points.origins, points.normals, points.numbers, points.lifts]
    arrays += map(np.asarray, receivers.opacity or ())
    for array in arrays:
        digest.update(repr((array.shape, array.dtype)).encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def _checksum(name: bytes, start: int, rows: bytes | memoryview) -> bytes:
    """Of a block that a power failure may have left as zeros, or that has another's name."""
    digest = hashlib.blake2b(name + start.to_bytes(8, "little"), digest_size=_CHECK)
    digest.update(rows)
    return digest.digest()


def _is_own(folder: Path) -> bool:
    """Whether a path is a folder of this user's, not a link to one."""
    try:
        status = folder.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(status.st_mode) and (not hasattr(os, "getuid") or status.st_uid == os.getuid())


def _remove(folder: Path) -> None:
    """Delete a folder of blocks; files of other names stay, and with them the folder."""
    with suppress(OSError):
        for path in folder.iterdir():
            if _FILE.fullmatch(path.name):
                path.unlink(missing_ok=True)
        folder.rmdir()
