"""An append-only file of finished blocks of work, locked by one process and readable after any crash.

Not SQLite or HDF5: blocks are only ever appended, and a file that a crash has cut is to be used as far as it is whole.
100 kills of each of three bakes lost nothing (evidence/reliability.md).
"""

import os
import stat
import struct
import sys
import zlib
from contextlib import suppress
from io import FileIO
from pathlib import Path

from raytrace.errors import OutputError

if sys.platform != "win32":
    import fcntl

MAGIC = b"obscurance journal 1\n"
IDENTITY = 32  # bytes
_UNSIGNED = MAGIC + bytes(IDENTITY)
_RECORD = struct.Struct("<16sqqqI")  # call, first row, last row, bytes of content, CRC-32 of these and of the content
_FIELDS = struct.Struct("<16sqqq")
_OPEN = os.O_RDWR | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)  # the last of named pipes, which hang

Block = tuple[bytes, int, int]


def record(block: Block, content: bytes) -> bytes:
    """One block as it is stored."""
    fields = *block, len(content)
    return _RECORD.pack(*fields, zlib.crc32(content, zlib.crc32(_FIELDS.pack(*fields)))) + content


class Journal:
    """An open journal, locked against other processes until it is closed or the process ends, however it ends.

    Attributes: identity: what it belongs to, 32 bytes, or None until it is signed. blocks: of each (call of 16 bytes,
        first row, last row), where its content begins in the file, and its bytes.

    Raises: OutputError: another process holds it, or it is of something else. OSError: it cannot be opened or read.
    """

    def __init__(self, path: Path, create: bool) -> None:
        self.path = path
        self._file = _open_locked(path, create)
        self.blocks: dict[Block, tuple[int, int]] = {}
        try:
            self._read()
        except BaseException:
            self._file.close()
            raise

    def _read(self) -> None:
        """Learn what is in the file, up to the first incomplete record. Raises: OutputError: it is another file."""
        # The header; a crash may have left a part of it, or zeros in place of what was not yet on the disk.
        head = self._file.read(len(_UNSIGNED))
        is_whole = head.startswith(MAGIC) and len(head) == len(_UNSIGNED)
        self.identity = head[len(MAGIC) :] if is_whole and head != _UNSIGNED else None
        if not is_whole:
            is_cut = head.startswith(MAGIC) or MAGIC.startswith(head.rstrip(b"\0"))
            chunks = iter(lambda: self._file.read(1 << 20), b"")
            if not is_cut or any(chunk.strip(b"\0") for chunk in chunks):
                raise _not_the_journal(self.path, "another file")
        # Records, each where the last whole one ends.
        self._end = self._file.tell() if self.identity else 0
        while self.identity and len(start := self._file.read(_RECORD.size)) == _RECORD.size:
            call, first_row, stop_row, size, check = _RECORD.unpack(start)
            if not 0 < size <= os.fstat(self._file.fileno()).st_size:
                break
            content = self._file.read(size)
            if len(content) < size or zlib.crc32(content, zlib.crc32(start[: _FIELDS.size])) != check:
                break
            self.blocks[call, first_row, stop_row] = self._end + _RECORD.size, size
            self._end = self._file.tell()

    def start(self) -> None:
        """Empty the file; nothing in it counts until `sign` has said what it belongs to."""
        self.blocks.clear()
        self._end, self.identity = 0, None
        self.append(_UNSIGNED)

    def sign(self, identity: bytes) -> None:
        """Make it the journal of `identity`; what was appended is on the disk when this returns."""
        os.fsync(self._file.fileno())
        if self.identity == identity:
            return
        self._file.seek(len(MAGIC))
        self._file.write(identity)
        os.fsync(self._file.fileno())
        self.identity = identity
        if sys.platform != "win32":
            folder = os.open(self.path.absolute().parent, os.O_RDONLY)
            try:
                os.fsync(folder)  # so that a power failure leaves the name too
            finally:
                os.close(folder)

    def content(self, block: Block) -> bytes:
        """The stored bytes of a block."""
        begin, size = self.blocks[block]
        self._file.seek(begin)
        return self._file.read(size)

    def append(self, *records: bytes) -> None:
        """Write `records` behind the last whole one.

        Raises: OSError: there is no space, or the file or its folder has gone.
        """
        self._file.seek(self._end)
        self._file.truncate()
        for content in records:
            unwritten = memoryview(content)
            while unwritten:  # a nearly full disk takes a part and refuses the next
                unwritten = unwritten[self._file.write(unwritten) :]
        self.path.stat()  # what has no name any more is kept for nobody
        self._end += sum(map(len, records))

    def close(self) -> None:
        self._file.close()

    def remove(self) -> None:
        """Delete the journal, and close it."""
        with suppress(OSError):
            self.path.unlink()
        self.close()


def _open_locked(path: Path, create: bool) -> FileIO:
    """Open the file and lock it; again if it was deleted meanwhile.

    Raises: OutputError: no journal, or locked by another.
    """
    while True:
        handle = os.open(path, _OPEN | (os.O_CREAT if create else 0), 0o666)
        file = FileIO(handle, "r+")
        try:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                raise _not_the_journal(path, "something that is not a regular file")
            if sys.platform != "win32":
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(handle), path.stat()):
                return file
        except OutputError:
            file.close()
            raise
        except BlockingIOError:
            file.close()
            raise OutputError(f"{path}: another bake to the same target is at work") from None
        except FileNotFoundError:
            pass  # its holder removed it between our opening and locking it
        file.close()
        if not create and not path.exists():
            raise FileNotFoundError(path)


def _not_the_journal(path: Path, got: str) -> OutputError:
    """The error for a file that is not the journal it should be. Args: got: what it is."""
    return OutputError(f"{path}: content: expected the journal of a bake or no such file, got {got}")
