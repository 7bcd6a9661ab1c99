"""Building the library of kernels: each becomes, for the types that its annotations name, object files, by several
processes.

These stay in a folder of the build, by names that hold what they are made of, so that only what was edited is
compiled again.
"""

import re
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from ..types import examples
from . import jit
from .identity import PACKAGES, ROOT
from .jit import Kernel
from .library import ABOUT, BUILT, POINTER, SOURCES, identity_of
from .signature import Signature

_DECORATOR = re.compile(r"^@(kernel|called_back|parallel|each|inline)\b", re.MULTILINE)
Progress = Callable[[int, int], None]


class Entry(NamedTuple):
    """A kernel for arguments of certain types."""

    signature: Signature
    identity: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]

    def file(self, folder: Path, level: str) -> Path:
        """The path of its object file for a level."""
        import numba

        return folder / f"{self.signature.symbol}.{self.identity}.{numba.__version__}.{level}.o"


def modules() -> list[str]:
    """Names of the project's modules that have kernels or helpers of kernels."""
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    found = [path for path in paths if _DECORATOR.search(path.read_text(encoding="utf-8"))]
    return [".".join(("obscurance", *path.relative_to(ROOT).with_suffix("").parts)) for path in found]


def entries(module: str) -> list[Entry]:
    """The annotated kernels of a module, for each of their types."""
    return [
        Entry(kernel.signature(arguments), identity_of(kernel.function), kernel.function, arguments)
        for kernel in vars(import_module(module)).values()
        if isinstance(kernel, Kernel) and kernel.__module__ == module and kernel.function.__annotations__
        for arguments in product(*examples(kernel.function).values())
    ]


class Objects(NamedTuple):
    """The object files that libraries are linked of."""

    files: dict[str, list[Path]]
    """The object files of each level."""
    names: list[str]
    """What a library shows."""


def objects(folder: Path, levels: Sequence[str], progress: Progress) -> Objects:
    """The object files of libraries for some levels, in `folder`, from which those of earlier builds go."""
    from .compiler import shared_object_file

    folder.mkdir(parents=True, exist_ok=True)
    by_module = {module: entries(module) for module in modules()}
    _compile(by_module, folder, levels, progress)
    built = [entry for group in by_module.values() for entry in group]
    files: dict[str, list[Path]] = {}
    for level in levels:
        shared = folder / f"shared.{level}.o"
        shared.write_bytes(shared_object_file(sorted(set(jit.externals)), level))
        files[level] = [shared, *(entry.file(folder, level) for entry in built)]
        for file in set(folder.glob(f"*.{level}.o")).difference(files[level]):
            file.unlink()
    symbols = [entry.signature.symbol for entry in built]
    names = [*symbols, *(symbol + ABOUT for symbol in symbols)]
    return Objects(files, [*names, BUILT, SOURCES, *(POINTER + name for name in jit.externals)])


def _compile(by_module: dict[str, list[Entry]], folder: Path, levels: Sequence[str], progress: Progress) -> None:
    """Make the object files of kernels, in as many processes as there are cores, each module's in one: they share much
    of what is compiled into them. Those with most arguments come before: they take longest."""
    lines = {
        module: [entry.signature.line for entry in group if not _is_built(entry, folder, levels)]
        for module, group in by_module.items()
    }
    longest = sorted(filter(lines.get, lines), key=lambda module: sum(map(len, lines[module])), reverse=True)
    done = 0
    with ProcessPoolExecutor() as pool:
        for work in as_completed([pool.submit(_compile_module, module, folder, levels) for module in longest]):
            done += work.result()
            progress(done, sum(map(len, lines.values())))


def _is_built(entry: Entry, folder: Path, levels: Sequence[str]) -> bool:
    return all(entry.file(folder, level).exists() for level in levels)


def _compile_module(module: str, folder: Path, levels: Sequence[str]) -> int:
    """Make the object files of a module's kernels that are not there yet. Returns: how many."""
    from .compiler import object_files

    missing = [entry for entry in entries(module) if not _is_built(entry, folder, levels)]
    for entry in missing:
        codes = object_files(entry.signature, entry.function, entry.arguments, levels, entry.identity)
        for level, code in zip(levels, codes, strict=True):
            target = entry.file(folder, level)
            partial = target.with_suffix(".partial")
            partial.write_bytes(code)
            partial.replace(target)
    return len(missing)
