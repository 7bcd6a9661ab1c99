"""Building the library of kernels: each kernel of a recorded list becomes an object file, by several processes.

The list, `kernels.txt`, has what the documents' commands and the tests load: they append it to a file that the variable
`OBSCURANCE_KERNELS` names, and `python -m raytrace.kernel.build record FILE` makes the list of it. Object files stay in
a folder of the build, by names that hold what they are made of, so that only what was edited is compiled again.
"""

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

from . import jit
from .identity import PACKAGES, ROOT
from .jit import Kernel
from .library import ABOUT, BUILT, POINTER, identity_of
from .signature import Signature, example

LIST = Path(__file__).with_name("kernels.txt")
_OURS = tuple(f"{package}." for package in (*PACKAGES, "scenes"))
Progress = Callable[[int, int], None]


class Entry(NamedTuple):
    """A line of the list, and what it stands for in the sources as they are."""

    line: str
    symbol: str
    identity: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    path: tuple[int, ...]

    @classmethod
    def of(cls, line: str) -> "Entry":
        """Raises: LookupError, AttributeError, ImportError, TypeError, ValueError: it stands for nothing."""
        kernel, path, arguments = example(line)
        if not isinstance(kernel, Kernel):
            raise TypeError(f"{line}: expected a kernel")
        signature: Signature = kernel.signature(arguments, path)
        return cls(line, signature.symbol, identity_of(kernel.function), kernel.function, arguments, path)

    def file(self, folder: Path, level: str) -> Path:
        """Where its object file for a level is."""
        import numba

        return folder / f"{self.symbol}.{self.identity}.{numba.__version__}.{level}.o"


def entries() -> list[Entry]:
    """What the list has of the sources as they are."""
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
    """What libraries are linked of."""

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
    _compile([entry.line for entry in listed if not _is_built(entry, folder, levels)], folder, levels, progress)
    built = [entry for entry in listed if _is_built(entry, folder, levels)]
    files: dict[str, list[Path]] = {}
    for level in levels:
        shared = folder / f"shared.{level}.o"
        shared.write_bytes(shared_object_file(sorted(set(jit.externals)), level))
        files[level] = [shared, *(entry.file(folder, level) for entry in built)]
        for file in set(folder.glob(f"*.{level}.o")).difference(files[level]):
            file.unlink()
    names = [name for entry in built for name in (entry.symbol, entry.symbol + ABOUT)]
    names += [BUILT, *(POINTER + name for name in jit.externals)]
    return Objects(files, names, [entry.line for entry in listed if entry not in built])


def _is_built(entry: Entry, folder: Path, levels: Sequence[str]) -> bool:
    return all(entry.file(folder, level).exists() for level in levels)


def _compile(lines: list[str], folder: Path, levels: Sequence[str], progress: Progress) -> None:
    """Make the object files of kernels, in as many processes as there are cores, each module's in one: they share much
    of what is compiled into them. The longest lines come before: much is compiled for arguments of many types."""
    waiting: SimpleQueue[list[str]] = SimpleQueue()
    modules = [list(group) for _, group in groupby(lines, _module)]
    for group in sorted(modules, key=lambda group: sum(map(len, group)), reverse=True):
        waiting.put(group)
    done: list[str] = []

    def work(_: int) -> None:
        command = [sys.executable, "-m", __name__, "compile", str(folder), *levels]
        with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as worker:
            assert worker.stdin
            assert worker.stdout
            with suppress(Empty):
                while True:
                    for line in waiting.get_nowait():
                        print(line, file=worker.stdin, flush=True)
                        if not worker.stdout.readline():
                            raise RuntimeError(f"the compiler ended at the kernel {line}")
                        done.append(line)
                        progress(len(done), len(lines))
            worker.stdin.close()

    if lines:
        count = min(len(modules), os.cpu_count() or 1)
        with ThreadPoolExecutor(count) as pool:
            list(pool.map(work, range(count)))


def _module(line: str) -> str:
    return line.split(" ")[0].rpartition(".")[0]


def _compile_as_told(folder: Path, levels: Sequence[str]) -> None:
    """Make the object files of each kernel that standard input names, and say so; of none that Numba refuses."""
    from numba.core.errors import NumbaError

    from .compiler import object_files

    for line in sys.stdin:
        entry = Entry.of(line.rstrip("\n"))
        try:
            codes = object_files(entry.symbol, entry.function, entry.identity, entry.arguments, entry.path, levels)
        except (NumbaError, TypeError):
            codes = []
        for level, code in zip(levels, codes, strict=False):
            target = entry.file(folder, level)
            partial = target.with_suffix(".partial")
            partial.write_bytes(code)
            partial.replace(target)
        print("done", flush=True)


def _record(loaded: Path) -> None:
    """Make the list of the kernels that were loaded, but for those that are no part of the package."""
    lines = sorted(set(loaded.read_text().splitlines()))
    LIST.write_text("".join(f"{line}\n" for line in lines if line.startswith(_OURS) and _entry(line)))


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["compile", folder, *levels]:
            _compile_as_told(Path(folder), levels)
        case ["record", loaded]:
            _record(Path(loaded))
