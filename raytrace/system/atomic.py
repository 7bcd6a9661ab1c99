"""Files that appear whole or not at all, and folders for what is on the way."""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path
from typing import Any, BinaryIO

from ..errors import OutputError
from .interrupts import at_once

if sys.platform != "win32":
    import fcntl

PathName = str | os.PathLike[str]
_BEGIN, _END = ".obscurance-", ".part"  # of temporary names


@contextmanager
def atomic_write(path: PathName) -> Iterator[BinaryIO]:
    """Open a binary file whose content takes the name `path` only when the block ends without an exception.

    The bytes go to a temporary file in the same folder, are flushed to the disk and renamed over `path`, or over what a
    link of that name leads to. When anything fails, an interrupt included, the temporary is removed and an existing
    `path` keeps its content; what is no OutputError passes through. The file mode is the umask's.
    """
    if is_standard_output(path):
        content = io.BytesIO()
        yield content
        _to_standard_output(content.getbuffer())
        return
    with _beside(path) as (_, handle), os.fdopen(handle, "wb") as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


@contextmanager
def atomic_path(path: PathName) -> Iterator[Path]:
    """`atomic_write` for libraries that open files themselves: the name of an empty file for them to overwrite."""
    if is_standard_output(path):
        from tempfile import TemporaryDirectory

        with TemporaryDirectory() as folder:
            scratch = Path(folder) / f"output{Path(path).suffix}"
            yield scratch
            _to_standard_output(scratch.read_bytes())
        return
    with _beside(path) as (temporary, handle):
        os.close(handle)
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())


@contextmanager
def _beside(path: PathName, replaces: bool = True) -> Iterator[tuple[Path, int]]:
    """A temporary file and its open handle; it replaces `path`, if at all, when the block ends without an exception."""
    try:
        target = _regular_target(path)
        _remove_left_over(target.parent)
        temporary = target.parent / f"{_BEGIN}{os.urandom(6).hex()}{_END}"
        lock = -1
        remove = partial(temporary.unlink, missing_ok=True)
        at_once.append(remove)
        try:  # from before the file is there: an interrupt may come as it is opened
            handle = _create(temporary)
            if sys.platform != "win32":
                lock = os.dup(handle)
            yield temporary, handle
            if replaces:
                os.replace(temporary, target)
        finally:
            with suppress(OSError):
                remove()
            at_once.remove(remove)
            if lock >= 0:
                os.close(lock)
    except OutputError:
        raise
    except OSError as reason:
        raise OutputError(f"{os.fspath(path)}: cannot write: {reason.strerror or reason}") from None


def standard_output(ending: str) -> Path:
    """A name for standard output, with the ending of the format that is written to it, "ply" for instance."""
    return Path(f"<stdout>.{ending}")


def is_standard_output(path: PathName) -> bool:
    """Whether `path` is one that `standard_output` made."""
    return Path(path).stem == "<stdout>"


def _to_standard_output(content: bytes | memoryview) -> None:
    """Write bytes to standard output, behind what was printed before."""
    sys.stdout.flush()
    sys.stdout.buffer.write(content)
    sys.stdout.flush()


def write_bytes(path: PathName, content: bytes | memoryview) -> None:
    """Write a file, whole or not at all. Raises: OutputError."""
    with atomic_write(path) as file:
        file.write(content)


def write_json(path: PathName, content: Any) -> None:
    """Write JSON, UTF-8, indented by two, whole or not at all. Raises: OutputError; ValueError: NaN or infinity."""
    import json

    write_bytes(path, (json.dumps(content, indent=2, allow_nan=False) + "\n").encode())


def check_writable(path: PathName) -> None:
    """Check before the work that `atomic_write(path)` will be able to start. Raises: OutputError."""
    if is_standard_output(path):
        if sys.stdout.isatty():
            raise OutputError("standard output: cannot write: it is a terminal; pipe it, or name a file")
        return
    with _beside(path, replaces=False) as (_, handle):
        os.close(handle)


def _regular_target(path: PathName) -> Path:
    """The file that `path` names after symbolic links; it need not exist."""
    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise OutputError(f"{os.fspath(path)}: cannot write: there is no folder {target.parent}")
    if target.is_dir():
        raise OutputError(f"{os.fspath(path)}: cannot write: it is a folder")
    if target.exists() and not target.is_file():
        raise OutputError(f"{os.fspath(path)}: cannot write: it is not a regular file")
    return target


def _create(path: Path) -> int:
    """Create a file that does not exist yet, open and locked: a file that nobody has locked is of a process that was
    killed."""
    while True:
        # os.open rather than tempfile: tempfile's mode is 0600 whatever the umask.
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        if sys.platform != "win32":
            with suppress(OSError):  # a file system without locks
                fcntl.flock(handle, fcntl.LOCK_EX)
        if os.fstat(handle).st_nlink:
            return handle
        os.close(handle)  # taken for one of the dead's before it was locked


@cache
def _remove_left_over(folder: Path) -> None:
    """Delete temporary files of processes that were killed; once in this process."""
    if sys.platform == "win32":
        return
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if not (entry.name.startswith(_BEGIN) and entry.name.endswith(_END)):
                continue
            with suppress(OSError):  # it is locked, or another user's
                handle = os.open(entry.path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    if os.fstat(handle).st_nlink:
                        os.unlink(entry.path)
                finally:
                    os.close(handle)
