"""Checks of the files that a command writes: none that it reads, none twice, and over no file of another kind."""

import os
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from ..errors import OptionError, OutputError
from .atomic import check_writable

Name = str | os.PathLike[str]
_MOST = 1 << 28  # bytes of a report or scene; anything larger is none
_OBJECTS = re.compile(rb"^[ \t]*(\[\[[ \t]*objects[ \t]*\]\]|objects[ \t]*=)", re.MULTILINE)


class _Kind(NamedTuple):
    """A kind of file that may be replaced: its name, and its first bytes or a test of all of them."""

    name: str
    starts: tuple[bytes, ...] = ()
    is_one: Callable[[bytes], bool] | None = None


def _is_page(content: bytes) -> bool:
    return b'<meta name="generator" content="obscurance' in content[:4096]


def _is_report(content: bytes) -> bool:
    return content.lstrip()[:1] == b"{" and b'"versions"' in content and b'"obscurance"' in content


_TIFF = _Kind("a TIFF picture", (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"))
_JPEG = _Kind("a JPEG picture", (b"\xff\xd8\xff",))
_KINDS = {
    ".npy": _Kind("a NumPy array", (b"\x93NUMPY",)),
    ".npz": _Kind("a NumPy archive", (b"PK\x03\x04", b"PK\x05\x06")),
    ".ply": _Kind("a PLY mesh", (b"ply\n", b"ply\r")),
    ".glb": _Kind("a GLB file", (b"glTF",)),
    ".exr": _Kind("an OpenEXR picture", (b"\x76\x2f\x31\x01",)),
    ".png": _Kind("a PNG picture", (b"\x89PNG\r\n\x1a\n",)),
    ".tif": _TIFF,
    ".tiff": _TIFF,
    ".jpg": _JPEG,
    ".jpeg": _JPEG,
    ".json": _Kind("a report of obscurance", is_one=_is_report),
    ".html": _Kind("a page of obscurance", is_one=_is_page),
    ".toml": _Kind("a scene", is_one=lambda content: bool(_OBJECTS.search(content))),
}


def check_outputs(outputs: Mapping[str, Name | None], inputs: Iterable[Name] = ()) -> None:
    """Check before the work that all files of a command can be written without a loss.

    Names that lead to one file, by links of either sort or by another spelling, count as one. An existing file is
    replaced if it is empty or of the kind that its name's ending says.

    Args:
        outputs: the files to write by what the user calls them, `--output` for instance; None: not asked for.
        inputs: every file that is read, whether it exists or not.

    Raises:
        OptionError: an output is an input, another output, or an existing file of another kind.
        OutputError: a folder is missing or refuses new files, or an output is something other than a file.
    """
    read = {_identity(path): path for path in inputs}
    written: dict[object, str] = {}
    for option, path in outputs.items():
        if path is None:
            continue
        check_writable(path)
        identity = _identity(path)
        if identity in read:
            raise OptionError(option, "a file that is not read", _also(path, read[identity], "an input"))
        if identity in written:
            raise OptionError(option, f"another file than {written[identity]}", f"{os.fspath(path)}, the same file")
        written[identity] = option
        _check_kind(option, path)


def make_folder(folder: Path) -> None:
    """Make a folder for outputs, and its parents, unless it is there. Raises: OutputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        what = "it is a file" if isinstance(reason, FileExistsError) else reason.strerror
        raise OutputError(f"{folder}: cannot make this folder: {what}") from None


def check_ending(option: str, path: Name, *endings: str) -> None:
    """Raises: OptionError: the name `path` ends in none of `endings`, upper or lower case."""
    if Path(path).suffix.lower() not in endings:
        raise OptionError(option, f"a name ending in {' or '.join(endings)}", os.fspath(path))


def _identity(path: Name) -> object:
    try:
        status = os.stat(path)
        if status.st_ino:
            return status.st_dev, status.st_ino
    except (OSError, ValueError):
        pass
    return os.path.normcase(os.path.realpath(path))


def _also(path: Name, other: Name, role: str) -> str:
    alias = "" if os.fspath(path) == os.fspath(other) else f": {os.fspath(other)}"
    return f"{os.fspath(path)}, {role}{alias}"


def _check_kind(option: str, path: Name) -> None:
    kind = _KINDS.get(Path(path).suffix.lower())
    if kind is None or not os.path.exists(path):
        return
    try:
        size = os.path.getsize(path)
        with open(path, "rb") as file:
            content = file.read(16) if kind.starts else file.read(_MOST)
    except OSError as reason:
        raise OptionError(option, f"a free name or {kind.name} to replace", f"{path}: {reason.strerror}") from None
    if size and not (content.startswith(kind.starts) if kind.is_one is None else kind.is_one(content)):
        raise OptionError(option, f"a free name or {kind.name} to replace", f"{os.fspath(path)}, another kind of file")
