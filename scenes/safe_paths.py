"""Names that files hold: of files they refer to, in their own folder or below, and as names of files to write."""

import re
from collections.abc import Iterable
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote

from obscurance.raytrace.errors import SceneError

from .json_toml import shown


def confined(name: str, folder: Path, source: object, field: str) -> Path:
    """The existing regular file `name`, relative to `folder`.

    Raises: SceneError: `name` is a URL or absolute, leaves the folder by ".." or by a symbolic link, or is no file.
    """
    windows = PureWindowsPath(name)
    if not name or "://" in name or windows.drive or windows.root or ".." in windows.parts:
        raise SceneError(source, field, "a path in the scene's folder or below", shown(name))
    try:
        root = folder.resolve()
        target = (root / name).resolve()
        inside = target.is_relative_to(root)
        exists = inside and target.exists()
        is_file = inside and target.is_file()
    except (OSError, ValueError, RuntimeError):
        raise SceneError(source, field, "a readable file", shown(name)) from None
    if not inside:
        raise SceneError(source, field, "a path in the scene's folder or below", f"{shown(name)}, a link out of it")
    if not exists:
        raise SceneError(source, field, "an existing file", shown(name))
    if not is_file:
        raise SceneError(source, field, "a file", f"{shown(name)}, which is none")
    return folder / name


def resolve_inside(name: str, folder: Path) -> Path | None:
    """The existing regular file `name`, with either slash, in `folder` or below, links followed, or None."""
    try:
        root = folder.resolve()
        target = (root / name.replace("\\", "/")).resolve()
        return target if target.is_relative_to(root) and target.is_file() else None
    except (OSError, ValueError):
        return None


def resolve_uri(uri: str, folder: Path) -> Path | None:
    """`resolve_inside` of a relative URI, percent-decoded or, where that is no file, as it is written."""
    return resolve_inside(unquote(uri), folder) or resolve_inside(uri, folder)


_RESERVED = re.compile(r"(?i:con|prn|aux|nul|com\d|lpt\d)$")  # by Windows, whatever follows a dot
_LONGEST = 60


def file_words(names: Iterable[str]) -> list[str]:
    """Names as parts of file names: without special characters, all different, also where case does not count."""
    words: list[str] = []
    taken: set[str] = set()
    for name in names:
        word = re.sub(r"[^\w-]+", "_", name).strip("_")[:_LONGEST] or "unnamed"
        word = f"{word}_" if _RESERVED.match(word) else word
        number, free = 1, word
        while free.casefold() in taken:
            number += 1
            free = f"{word}-{number}"
        taken.add(free.casefold())
        words.append(free)
    return words
