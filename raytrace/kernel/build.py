"""Building the library of kernels: each kernel of a recorded list becomes an object file, by several processes.

The list, `kernels.txt`, has what the documents' commands and the tests load: they append it to a file that the variable
`OBSCURANCE_KERNELS` names, and `python -m raytrace.kernel.build FILE` makes the list of it, with all combinations of
the types that arguments were seen to have. Object files stay in a folder of the build, by names that hold what they are
made of, so that only what was edited is compiled again.
"""

import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from itertools import groupby, product
from pathlib import Path
from typing import Any, NamedTuple

from . import jit
from .identity import PACKAGES
from .jit import Kernel
from .library import ABOUT, BUILT, POINTER, SOURCES, identity_of
from .signature import Signature, example

LIST = Path(__file__).with_name("kernels.txt")
_OURS = tuple(f"{package}." for package in (*PACKAGES, "scenes"))
Progress = Callable[[int, int], None]


class Entry(NamedTuple):
    """A line of the list, and what it stands for in the sources as they are."""

    signature: Signature
    identity: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]

    @classmethod
    def of(cls, line: str) -> "Entry":
        """What a line of the list stands for.

        Raises: LookupError, AttributeError, ImportError, TypeError, ValueError: nothing.
        """
        kernel, path, arguments = example(line)
        if not isinstance(kernel, Kernel):
            raise TypeError(f"{line}: expected a kernel")
        function = kernel.function
        return cls(kernel.signature(arguments, path), identity_of(function), function, arguments)

    def file(self, folder: Path, level: str) -> Path:
        """The path of its object file for a level."""
        import numba

        return folder / f"{self.signature.symbol}.{self.identity}.{numba.__version__}.{level}.o"


def entries() -> list[Entry]:
    """The entries of the list `kernels.txt`, without kernels that the sources no longer have."""
    return [entry for line in LIST.read_text().splitlines() if (entry := _entry(line))]


def _entry(line: str) -> Entry | None:
    """What a line stands for; None if the sources have no longer the kernel, or a type of its arguments.

    Raises: ModuleNotFoundError: a library that the sources import is not there.
    """
    try:
        return Entry.of(line)
    except ModuleNotFoundError as missing:
        if not f"{missing.name}.".startswith(_OURS):
            raise
    except (LookupError, AttributeError, ImportError, TypeError, ValueError):
        pass
    return None


class Objects(NamedTuple):
    """The object files that libraries are linked of, the names of C functions that they want, and how many were
    stale."""

    files: dict[str, list[Path]]
    """The object files of each level."""
    names: list[str]
    """What a library shows."""
    stale: list[str]
    """Lines of the list whose types the sources do not compile for any more."""


def objects(folder: Path, levels: Sequence[str], progress: Progress) -> Objects:
    """The object files of libraries for some levels, in `folder`, from which those of earlier builds go."""
    from .compiler import shared_object_file

    folder.mkdir(parents=True, exist_ok=True)
    listed = entries()
    _compile([entry for entry in listed if not _is_built(entry, folder, levels)], folder, levels, progress)
    built = [entry for entry in listed if _is_built(entry, folder, levels)]
    files: dict[str, list[Path]] = {}
    for level in levels:
        shared = folder / f"shared.{level}.o"
        shared.write_bytes(shared_object_file(sorted(set(jit.externals)), level))
        files[level] = [shared, *(entry.file(folder, level) for entry in built)]
        for file in set(folder.glob(f"*.{level}.o")).difference(files[level]):
            file.unlink()
    symbols = [entry.signature.symbol for entry in built]
    names = [*symbols, *(symbol + ABOUT for symbol in symbols)]
    names += [BUILT, SOURCES, *(POINTER + name for name in jit.externals)]
    return Objects(files, names, [entry.signature.line for entry in listed if entry not in built])


def _is_built(entry: Entry, folder: Path, levels: Sequence[str]) -> bool:
    return all(entry.file(folder, level).exists() for level in levels)


def _compile(listed: list[Entry], folder: Path, levels: Sequence[str], progress: Progress) -> None:
    """Make the object files of kernels, in as many processes as there are cores, each module's in one: they share much
    of what is compiled into them. The longest lines come before: much is compiled for arguments of many types."""
    lines = [entry.signature.line for entry in listed]
    modules = [list(group) for _, group in groupby(lines, lambda line: line.split(" ")[0].rpartition(".")[0])]
    done = 0
    with ProcessPoolExecutor() as pool:
        longest = sorted(modules, key=lambda group: sum(map(len, group)), reverse=True)
        for work in as_completed([pool.submit(_compile_module, group, folder, levels) for group in longest]):
            done += work.result()
            progress(done, len(lines))


def _compile_module(lines: list[str], folder: Path, levels: Sequence[str]) -> int:
    """Make the object files of some kernels, but of none that Numba refuses. Returns: how many were to be made."""
    from numba.core.errors import NumbaError

    from .compiler import object_files

    for entry in map(Entry.of, lines):
        codes: list[bytes] = []
        with suppress(NumbaError, TypeError):
            codes = object_files(entry.signature, entry.function, entry.arguments, levels, entry.identity)
        for level, code in zip(levels, codes, strict=False):
            target = entry.file(folder, level)
            partial = target.with_suffix(".partial")
            partial.write_bytes(code)
            partial.replace(target)
    return len(lines)


def completed(lines: Iterable[str]) -> list[str]:
    """Lines of a list, and those of all combinations of their arguments' types, sorted.

    An argument may have each type that it has in some line of its kernel; a record, those of all kernels.
    """
    rows: dict[tuple[str, int], list[list[str]]] = defaultdict(list)
    types: dict[str, set[str]] = defaultdict(set)
    for line in lines:
        name, *arguments = _split(line)
        rows[name, len(arguments)].append(arguments)
        for argument in arguments:
            types[_record_of(argument)].add(argument)
    every: list[str] = []
    for (name, _), kernel_rows in rows.items():
        columns = zip(*kernel_rows, strict=True)
        choices = (set().union(*(types[_record_of(argument)] for argument in column)) for column in columns)
        every += (" ".join((name, *arguments)) for arguments in product(*choices))
    return sorted(every)


def _split(line: str) -> list[str]:
    """The kernel's name and the types of its arguments, each with what is in its brackets."""
    parts: list[str] = []
    depth = 0
    for word in line.split():
        if depth:
            parts[-1] += f" {word}"
        else:
            parts.append(word)
        depth += word.endswith("(") - (word == ")")
    return parts


def _record_of(argument: str) -> str:
    """What arguments have in common whose types replace one another: a record's name, or all of another type."""
    name = argument.partition(" ")[0]
    return argument if name == "(" else name


def _record(loaded: Path) -> None:
    """Write the list `kernels.txt` anew, of the kernels that were loaded, without those outside of the package."""
    lines = [line for line in set(loaded.read_text().splitlines()) if line.startswith(_OURS) and _entry(line)]
    LIST.write_text("".join(f"{line}\n" for line in completed(lines)))


if __name__ == "__main__":
    _record(Path(sys.argv[1]))
