"""Compilation of hot loops: one decorator, and a cache that notices every edit.

Numba keys its disk cache by the file a kernel stands in, so an edit of a helper in another file would leave
a stale kernel behind. `kernel` therefore points the cache at a folder named by a hash of all kernel sources,
inside the user's cache folder, which also serves read-only installations. ``NUMBA_CACHE_DIR`` overrides the parent.
"""

from __future__ import annotations

import getpass
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from pickle import UnpicklingError
from typing import Any, TypeVar

import numba
import platformdirs

F = TypeVar("F", bound=Callable[..., Any])

PACKAGES = ("raytrace", "ao")
_NEEDED = 16 << 20  # bytes; all kernels take less than 5 MB
ROOT = Path(__file__).resolve().parents[2]


def source_hash(root: Path = ROOT) -> str:
    """Hash of every source file that can hold or feed a kernel, and of Numba's version: 16 hex digits."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


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


def _chosen() -> Path:
    """Raises: LookupError: nothing is chosen."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
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
    """Folder of compiled kernels for exactly these sources, if one can be written."""
    parent = user_cache()
    return parent / source_hash() if parent else None


def is_warm(module: str) -> bool:
    """Whether an earlier run has left the compiled kernels of a module, such as "tile", as its source is now."""
    folder = cache_folder()
    return folder is not None and any(folder.glob(f"**/{module}.*.nbc"))


def kernel(function: F) -> F:
    """Compile a hot loop on first call: no Python objects, no GIL, cached on disk."""
    with _own_cache() as cached:
        compiled = numba.njit(nogil=True, cache=cached, error_model="numpy")(function)
    if cached:
        store = compiled._cache
        store.load_overload, store.save_overload = _if_it_can(store.load_overload), _if_it_can(store.save_overload)
    return compiled


def callback(signature: Any) -> Callable[[F], Any]:
    """Compile a function of this signature for C to call by its `address`, cached like a kernel."""

    def compile_(function: F) -> Any:
        with _own_cache() as cached:
            store = _if_it_can(lambda: numba.cfunc(signature, cache=cached)(function))
            return store() or numba.cfunc(signature)(function)

    return compile_


def _if_it_can(use: Callable[..., Any]) -> Callable[..., Any]:
    """`use` of the cache, or None: its disk may have filled up, a crash may have left half a file."""

    def attempt(*arguments: Any) -> Any:
        try:
            return use(*arguments)
        except (OSError, EOFError, UnpicklingError):
            return None

    return attempt


@contextmanager
def _own_cache() -> Iterator[bool]:
    """Numba's cache in `cache_folder` meanwhile; whether there is one."""
    before, folder = numba.config.CACHE_DIR, cache_folder()
    numba.config.CACHE_DIR = str(folder or "")
    try:
        yield folder is not None
    finally:
        numba.config.CACHE_DIR = before


def inline(function: F) -> F:
    """Compile a helper that kernels call; it is compiled into each of them."""
    return numba.njit(nogil=True, error_model="numpy", forceinline=True)(function)
