"""The inputs of a batch and the outputs that they get: patterns expanded, names that clash refused."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from raytrace.errors import OptionError
from raytrace.system.outputs import check_outputs, make_folder

MANIFEST = "manifest.json"
_ENDINGS = (".ply", ".obj", ".glb", ".gltf", ".stl", ".off", ".3mf")  # of which a folder's pattern is made up


def expand(given: Iterable[Path]) -> list[Path]:
    """Files by their names, and those that patterns of `glob` match, each once.

    Raises:
        OptionError: a folder, or a pattern that matches nothing.
    """
    found: dict[str, Path] = {}
    for path in given:
        if os.path.isdir(path):
            raise OptionError("mesh", "mesh files", f"{path}, a folder", nearest=_pattern_in(path))
        matches = [path]
        if is_pattern(path):
            matches = [Path(name) for name in sorted(glob.glob(str(path), recursive=True)) if os.path.isfile(name)]
            if not matches:
                raise OptionError("mesh", "a pattern that matches files", f"{path}, which matches none")
        for match in matches:
            found.setdefault(os.path.realpath(match), match)
    return list(found.values())


def is_pattern(path: Path) -> bool:
    """Whether a name is no file's, but a pattern of `glob`."""
    return glob.has_magic(str(path)) and not os.path.exists(path)


def _pattern_in(folder: Path) -> str | None:
    """A pattern of the mesh files in a folder, in quotes as a shell takes it."""
    endings = [entry.suffix.lower() for entry in folder.iterdir()]
    most = max(_ENDINGS, key=endings.count)
    return f"'{folder / '*'}{most}'" if most in endings else None


def outputs_in(folder: Path, inputs: Sequence[Path], ending: str) -> list[Path]:
    """An output for each input: its name, with another ending, in `folder`.

    Raises: OptionError: two inputs would have one output.
    """
    outputs: dict[str, tuple[Path, Path]] = {}
    for path in inputs:
        output = folder / f"{path.stem}.{ending}"
        other = outputs.setdefault(os.path.normcase(output), (output, path))[1]
        if other is not path:
            raise OptionError("output_dir", "inputs of different names", f"{other} and {path}, both for {output}")
    return [output for output, _ in outputs.values()]


@contextmanager
def made(folder: Path, keep: bool = True) -> Iterator[None]:
    """Make a folder for outputs, unless it is there; if the checks in the block fail, it goes again.

    Args: keep: whether it stays otherwise.

    Raises: OutputError: it cannot be made.
    """
    new = [each for each in (folder, *folder.parents) if not os.path.exists(each)]
    make_folder(folder)
    passed = False
    try:
        yield
        passed = True
    finally:
        if not (passed and keep):
            for each in new:
                each.rmdir()


def check_batch(inputs: Iterable[Path], outputs: Iterable[Path], manifest: Path) -> None:
    """Raises: OptionError, OutputError: an output of a batch, or its manifest, cannot be written, or is an input."""
    written: dict[str, Path | None] = {f"output {path.name}": path for path in outputs}
    check_outputs({**written, "manifest": manifest}, inputs)
