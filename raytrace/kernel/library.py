"""The library of kernels that was built with the package, one for each level of processors.

It holds, for each kernel and types of arguments, the machine code and a text about it; and for each C function that
kernels call a pointer, which is set when that function is there. It also has the identities of the sources that it was
built with, which take half a second to make.
"""

import ctypes
import sys
from collections.abc import Iterable
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import numpy as np

from .identity import ROOT, digest, kernel_identity, result_sources, source_identity
from .processor import level, machine

ABOUT = "_about"
"""End of the name of a kernel's text: the formats of its results, a line with its identity."""
POINTER = "pointer_to_"
"""Beginning of the name of a pointer."""
BUILT = "built_by"
SOURCES = "sources"
_HOW_TO_BUILD = "in the source folder `python -m pip install .`, or `make install`, builds them"
_COMPILER = tuple(f"raytrace/kernel/{name}.py" for name in ("compiler", "lanes"))
_pointers: dict[str, ctypes.c_void_p] = {}
_compares = [(ROOT / "pyproject.toml").is_file()]  # whether sources may be others than the library was built of


def file_of(level: str) -> Path:
    """The path of the library for a level of processors and this Python; it may not have been built."""
    return Path(__file__).with_name(level.replace("-", "_") + EXTENSION_SUFFIXES[0])


@cache
def _library() -> ctypes.CDLL | None:
    """The library for this processor, None if it has not been built."""
    file = file_of(level())
    return ctypes.CDLL(str(file)) if file.is_file() else None


def find(symbol: str, function: object) -> tuple[str, int] | None:
    """The formats of a kernel's results and the address of its code, if the library has it.

    In a source tree it must have been made of this very function and all that it calls. What is installed is not
    compared, unless `compare_sources` was called.
    """
    library = _library()
    if library is None or not hasattr(library, symbol):
        return None
    formats, made_of = about(ctypes.addressof(ctypes.c_char.in_dll(library, symbol + ABOUT)))
    if _compares[0] and made_of != identity_of(function):
        return None
    return formats, ctypes.cast(getattr(library, symbol), ctypes.c_void_p).value or 0


def compare_sources() -> None:
    """Take kernels from the library only where they are made of the functions that this process has, from now on."""
    _compares[0] = True


def about(address: int) -> tuple[str, str]:
    """The formats of a kernel's results, and its identity: the text that stands at an address in the library."""
    formats, _, identity = ctypes.string_at(address).decode().partition("\n")
    return formats, identity


def identity_of(function: object) -> str:
    """Hash of what a kernel is made of, and of what makes code of it."""
    return f"{_compiler_identity()}{kernel_identity(function)}"


@cache
def _compiler_identity() -> str:
    """Hash of the sources of ours that decide what code is made of a kernel: 16 hex digits."""
    return digest(_identities(_COMPILER))


@cache
def results_identity() -> str:
    """Hash of every source that results may depend on, and of NumPy's and Python's versions: 16 hex digits."""
    paths = result_sources()
    return digest([np.__version__, sys.version, *paths, *_identities(paths)])


def _identities(paths: Iterable[str]) -> list[str]:
    """`source_identity` of source files, of which only those are made that the library has not."""
    known = dict(line.split() for line in _text(SOURCES).splitlines())
    texts = map(_source, paths)
    return [known.get(digest([text])) or source_identity(text) for text in texts]


def identities_of_sources() -> str:
    """A line for each source that results may depend on: the hash of its text, `source_identity`."""
    paths = result_sources()
    hashes = [digest([_source(path)]) for path in paths]
    return "\n".join(map(" ".join, zip(hashes, _identities(paths), strict=True)))


def _source(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def built_by() -> str:
    """The library's level, and what compiled it, such as "x86-64-v3 by Numba 0.68.1, LLVM 20.1.8"."""
    return f"{level()} by {_text(BUILT) or 'none'}"


def _text(name: str) -> str:
    """A text of the library, empty where it has none of this name."""
    library = _library()
    if library is None or not hasattr(library, name):
        return ""
    return ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(library, name))).decode()


def provide(name: str, address: int) -> None:
    """Let kernels call the C function of this name."""
    _pointers[name] = ctypes.c_void_p(address)
    library = _library()
    if library and hasattr(library, POINTER + name):  # else it is from before kernels called this
        ctypes.c_void_p.in_dll(library, POINTER + name).value = address


def pointers() -> dict[str, int]:
    """Where the library keeps pointers to the functions that were provided, by their names."""
    return {POINTER + name: ctypes.addressof(pointer) for name, pointer in _pointers.items()}


def what_is_missing(kernel: str) -> str:
    """The message where the library has no code of a kernel, a signature's line, and nothing compiles it."""
    if _library():
        advice = "Numba compiles what is not in it: `python -m pip install numba`"
        return f"{kernel}: expected a kernel of the library that was built with the package; {advice}"
    return f"kernels: expected those for this processor ({machine()}), got none; {_HOW_TO_BUILD}"
