"""The files of one bake. The inputs of a batch and their outputs: patterns expanded, names that clash refused."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from raytrace.errors import OptionError
from raytrace.system.checks import make_folder

from ..formats.table import endings

if TYPE_CHECKING:
    from raytrace.mesh.mesh import Mesh

    from ..formats.load import MeshFile
    from ..formats.objects import ObjectSelection

MANIFEST = "manifest.json"


class Sources(NamedTuple):
    """The files of a bake."""

    source: MeshFile
    chosen: ObjectSelection  # of the source
    fine: Mesh | None  # the finer meshes as one
    occluders: list[Mesh]  # besides
    arguments: dict[str, Any]  # those of `ao.bake` and `ao.bake_texture` beside the mesh
    files: list[Path]
    notes: list[str]

    @property
    def solid(self) -> Mesh:
        """Whose w is baked."""
        return self.fine or self.chosen.mesh

    @property
    def counts(self) -> tuple[int, int]:
        """Vertices and faces that occlude."""
        meshes = [*self.occluders, self.solid]
        return sum(len(each.vertices) for each in meshes), sum(len(each.faces) for each in meshes)

    @property
    def meshes(self) -> list[Mesh]:
        """All that occlude, that whose w is baked last."""
        return [*self.occluders, self.chosen.mesh, *([self.fine] if self.fine else [])]


def expand(given: Iterable[Path]) -> list[Path]:
    """Files by names and patterns, each once. Raises: OptionError: a folder, or a pattern that matches nothing."""
    paths: dict[str, Path] = {}
    for path in given:
        if os.path.isdir(path):
            raise OptionError("mesh", "mesh files", f"{path}, a folder", nearest=_pattern_in(path))
        matches = [path]
        if is_pattern(path):
            matches = [Path(name) for name in sorted(glob.glob(str(path), recursive=True)) if os.path.isfile(name)]
            if not matches:
                raise OptionError("mesh", "a pattern that matches files", f"{path}, which matches none")
        for match in matches:
            paths.setdefault(os.path.realpath(match), match)
    return list(paths.values())


def is_pattern(path: Path) -> bool:
    """Whether a name is no file's, but a pattern of `glob`."""
    return glob.has_magic(str(path)) and not os.path.exists(path)


def _pattern_in(folder: Path) -> str | None:
    """A pattern of the mesh files in a folder, in quotes as a shell takes it."""
    found = [entry.suffix.lower() for entry in folder.iterdir()]
    most = max(endings("read"), key=found.count)
    return f"'{folder / '*'}{most}'" if most in found else None


def outputs_in(folder: Path, inputs: Sequence[Path], ending: str) -> list[Path]:
    """An output for each input: its name, with another ending, in `folder`.

    Where names are equal the outputs lie below `folder` as the inputs do below the folder that holds them all.
    """
    names = [Path(f"{path.stem}.{ending}") for path in inputs]
    if len({os.path.normcase(name) for name in names}) < len(names):
        folders = [os.path.abspath(path.parent) for path in inputs]
        with suppress(ValueError):  # they are on several drives
            top = os.path.commonpath(folders)
            names = [Path(os.path.relpath(each, top), name) for each, name in zip(folders, names, strict=True)]
    first: dict[str, Path] = {}
    for path, name in zip(inputs, names, strict=True):
        other = first.setdefault(os.path.normcase(name), path)
        if other is not path:
            expected = "inputs of different names in each folder"
            raise OptionError("output_dir", expected, f"{other} and {path}, both for {folder / name}")
    return [folder / name for name in names]


@contextmanager
def made(folders: Iterable[Path], keep: bool = True) -> Iterator[None]:
    """Make folders, unless they are there; they go if that or the block fails, or not `keep`. Raises: OutputError."""
    several = dict.fromkeys(folders)
    new = {each for folder in several for each in (folder, *folder.parents) if not os.path.exists(each)}
    passed = False
    try:
        for folder in several:
            make_folder(folder)
        yield
        passed = True
    finally:
        if not (passed and keep):
            for each in sorted(new, reverse=True):  # the deepest first
                with suppress(OSError):
                    each.rmdir()
