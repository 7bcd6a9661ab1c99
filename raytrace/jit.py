"""Compilation of hot loops: one decorator, and a cache that notices every edit.

Numba keys its disk cache by the file a kernel stands in, so an edit of a helper in another file would leave
a stale kernel behind. `kernel` therefore points the cache at a folder named by a hash of all kernel sources,
inside the user's cache folder, which also serves read-only installations. ``NUMBA_CACHE_DIR`` overrides the parent.
"""

from __future__ import annotations

import getpass
import hashlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])

PACKAGES = ("raytrace", "ao")
ROOT = Path(__file__).resolve().parent.parent


def source_hash(root: Path = ROOT) -> str:
    """Hash of every source file that can hold or feed a kernel, and of Numba's version: 16 hex digits."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def user_cache() -> Path:
    """Parent of the kernel caches: the first writable of ``NUMBA_CACHE_DIR``, the user's cache, the temporary one."""
    xdg = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    wanted = [Path(chosen)] if chosen else []
    wanted += [Path(xdg) / "obscurance", Path(tempfile.gettempdir()) / f"obscurance-{getpass.getuser()}"]
    for folder in wanted:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return wanted[-1]


@cache
def cache_folder() -> Path:
    """Folder of compiled kernels for exactly these sources."""
    return user_cache() / source_hash()


def is_warm(module: str) -> bool:
    """Whether an earlier run has left the compiled kernels of a module, such as "tile", as its source is now."""
    return any(cache_folder().glob(f"**/{module}.*.nbc"))


def kernel(function: F) -> F:
    """Compile a hot loop on first call: no Python objects, no GIL, cached on disk."""
    with _own_cache():
        return numba.njit(nogil=True, cache=True, error_model="numpy")(function)


def callback(signature: Any) -> Callable[[F], Any]:
    """Compile a function of this signature for C to call by its `address`, cached like a kernel."""

    def compile_(function: F) -> Any:
        with _own_cache():
            return numba.cfunc(signature, cache=True)(function)

    return compile_


@contextmanager
def _own_cache() -> Iterator[None]:
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(cache_folder())
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before


def inline(function: F) -> F:
    """Compile a helper that kernels call; it is compiled into each of them."""
    return numba.njit(nogil=True, error_model="numpy", forceinline=True)(function)
