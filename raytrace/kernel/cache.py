"""Machine code of kernels on disk: a file for each kernel and types of arguments.

Its name holds the kernel's identity, and that of the folder a hash of the compiler and of the processor, so that an
edit is compiled where it matters. The folder is in the user's cache folder, which also serves read-only installations;
``NUMBA_CACHE_DIR`` overrides the parent. Code is only read from what nobody but this user and root can write.
"""

import getpass
import hashlib
import os
import re
import shutil
import stat
import tempfile
import zlib
from contextlib import suppress
from functools import cache
from pathlib import Path

import llvmlite.binding
import platformdirs

from .identity import compiler_identity

_NEEDED = 16 << 20  # bytes; all kernels take less than 5 MB
_CHECKSUM = 4  # bytes before the code
_FOLDER, _FILE = 0o755, 0o644  # modes
_SETTING = re.compile("NUMBA_(?!CACHE_DIR$|NUM_THREADS$)")  # that code may depend on


def numba_settings() -> str:
    """Numba's settings, which code is compiled for: of the environment, and of its file in the current folder."""
    settings = sorted("=".join(item) for item in os.environ.items() if _SETTING.match(item[0]))
    with suppress(OSError):
        settings.append(Path(".numba_config.yaml").read_text(errors="replace"))
    return " ".join(settings)


def _user() -> str:
    try:
        return getpass.getuser()
    except (LookupError, OSError, ImportError):  # a user without a name, as containers have them
        return str(os.getuid())


@cache
def _places() -> tuple[Path, ...]:
    """Folders for exactly this compiler and this processor, whether they exist or not, the best one first."""
    features = llvmlite.binding.get_host_cpu_features().flatten()
    machine = hashlib.sha256(f"{llvmlite.binding.get_host_cpu_name()} {features} {numba_settings()}".encode())
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    name = f"{compiler_identity()}-{machine.hexdigest()[:8]}"
    parents = [Path(chosen)] if chosen else []
    with suppress(OSError, LookupError, RuntimeError):  # a user without a home
        users = platformdirs.user_cache_path("obscurance", appauthor=False)
        parents += [users] if users.is_absolute() else []  # earlier releases leave a "~" as it is
    with suppress(OSError):
        parents.append(Path(tempfile.gettempdir()) / f"obscurance-{_user()}")
    return tuple(parent / name for parent in parents)


def _is_private(status: os.stat_result) -> bool:
    """Whether nobody but this user and root can have written to a file or folder: theirs, open to no one, no link."""
    if os.name != "posix":
        return True
    is_open = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) or stat.S_ISLNK(status.st_mode)
    return status.st_uid in (0, os.geteuid()) and not is_open


def _is_safe(folder: Path) -> bool:
    """Whether a folder and its parent, as far as they exist, are private. Raises: OSError."""
    return all(_is_private(path.lstat()) for path in (folder.parent, folder) if os.path.lexists(path))


@cache
def cache_folder() -> Path | None:
    """Where compiled kernels are kept: the first folder that can be written, by nobody else; None if there is none."""
    for folder in _places():
        with suppress(OSError):
            folder.parent.mkdir(_FOLDER, parents=True, exist_ok=True)
            if _is_safe(folder) and shutil.disk_usage(folder.parent).free >= _NEEDED:
                with tempfile.TemporaryFile(dir=folder.parent):
                    return folder
    return None


def read_code(name: str) -> bytes | None:
    """Code that `write_code` kept by this name; None unless it is whole: a crash may leave half a file. Folders before
    `cache_folder` count, which this user cannot write to: an administrator may have filled one."""
    places = _places()
    last = cache_folder()
    for folder in places[: places.index(last) + 1] if last else places:
        with suppress(OSError):
            if not _is_safe(folder):
                continue
            handle = os.open(folder / name, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0))
            with open(handle, "rb") as file:
                stored = file.read() if _is_private(os.fstat(handle)) else b""
            code = stored[_CHECKSUM:]
            if code and stored[:_CHECKSUM] == _checksum(name, code):
                return code
    return None


def write_code(name: str, code: bytes) -> None:
    """Keep code for later processes, if the disk lets it."""
    folder = cache_folder()
    if folder is None:
        return
    partial = folder / f"{name}.{os.getpid()}"
    with suppress(OSError):
        try:
            folder.mkdir(_FOLDER, exist_ok=True)
            partial.touch(_FILE, exist_ok=False)
            partial.write_bytes(_checksum(name, code) + code)
            partial.replace(folder / name)
        except OSError:
            partial.unlink(missing_ok=True)


def _checksum(name: str, code: bytes) -> bytes:
    return zlib.crc32(code, zlib.crc32(name.encode())).to_bytes(_CHECKSUM)
