"""Machine code of kernels on disk: a file for each kernel and types of arguments, in a folder that every edit renames.

A kernel holds code of helpers from other files, so the folder is named by a hash of all sources that can hold or feed
one, and of everything else that machine code depends on. It is in the user's cache folder, which also serves read-only
installations; ``NUMBA_CACHE_DIR`` overrides the parent.
"""

from __future__ import annotations

import getpass
import hashlib
import os
import shutil
import sys
import tempfile
import zlib
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import llvmlite.binding
import numpy as np
import platformdirs

PACKAGES = ("raytrace", "ao")
_NEEDED = 16 << 20  # bytes; all kernels take less than 5 MB
_CHECKSUM = 4  # bytes before the code
ROOT = Path(__file__).resolve().parents[2]


@cache
def source_hash(root: Path = ROOT) -> str:
    """Hash of every source file that can hold or feed a kernel, and of Numba's, NumPy's and Python's: 16 hex digits."""
    numba = find_spec("numba")  # not imported, which takes longer than most bakes
    version = Path(numba.origin).with_name("_version.py").read_bytes() if numba and numba.origin else b""
    digest = hashlib.sha256(version + f"{np.__version__} {sys.version}".encode())
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _machine() -> str:
    """Hash of the processor and of Numba's settings, which code is compiled for: 8 hex digits."""
    features = llvmlite.binding.get_host_cpu_features().flatten()
    settings = sorted(item for item in os.environ.items() if item[0].startswith("NUMBA_") and item[0] != _CHOSEN)
    text = f"{llvmlite.binding.get_host_cpu_name()} {features} {settings}"
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def user_cache() -> Path | None:
    """Parent of the kernel caches: the first with space of ``NUMBA_CACHE_DIR``, the user's cache, the temporary folder.

    None where nothing can be written: kernels are then compiled anew in every process.
    """
    for place in (_chosen, _users, _temporary):
        try:
            folder = place()
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                if shutil.disk_usage(folder).free >= _NEEDED:
                    return folder
        except (OSError, LookupError, RuntimeError):
            continue
    return None


_CHOSEN = "NUMBA_CACHE_DIR"


def _chosen() -> Path:
    """Raises: LookupError: nothing is chosen."""
    chosen = os.environ.get(_CHOSEN)
    if not chosen:
        raise LookupError
    return Path(chosen)


def _users() -> Path:
    """Raises: RuntimeError: a user without a home."""
    folder = platformdirs.user_cache_path("obscurance", appauthor=False)
    if not folder.is_absolute():  # earlier releases leave a "~" as it is
        raise RuntimeError
    return folder


def _temporary() -> Path:
    """Raises: OSError: there is none."""
    return Path(tempfile.gettempdir()) / f"obscurance-{_name()}"


def _name() -> str:
    try:
        return getpass.getuser()
    except (LookupError, OSError, ImportError):  # a user without a name, as containers have them
        return str(os.getuid())


@cache
def cache_folder() -> Path | None:
    """Folder of compiled kernels for exactly these sources and this processor, if one can be written."""
    parent = user_cache()
    return parent / f"{source_hash()}-{_machine()}" if parent else None


def is_kept(path: str) -> bool:
    """Whether the code of kernels in this source file is kept: an edit of other files would not be noticed."""
    return any(Path(path).is_relative_to(ROOT / package) for package in PACKAGES)


def read_code(name: str) -> bytes | None:
    """What `write_code` kept by this name, if it is there and whole, not half a file after a crash."""
    folder = cache_folder()
    if folder is None:
        return None
    try:
        stored = (folder / name).read_bytes()
    except OSError:
        return None
    checksum, code = stored[:_CHECKSUM], stored[_CHECKSUM:]
    return code if zlib.crc32(code).to_bytes(_CHECKSUM) == checksum and code else None


def write_code(name: str, code: bytes) -> None:
    """Keep code for later processes, if the disk lets it."""
    folder = cache_folder()
    if folder is None:
        return
    partial = folder / f"{name}.{os.getpid()}"
    with suppress(OSError):
        try:
            folder.mkdir(exist_ok=True)
            partial.write_bytes(zlib.crc32(code).to_bytes(_CHECKSUM) + code)
            partial.replace(folder / name)
        except OSError:
            partial.unlink(missing_ok=True)
