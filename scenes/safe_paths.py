"""Files that a scene refers to: in its own folder or below, nowhere else."""

from __future__ import annotations

from pathlib import Path, PureWindowsPath

from raytrace.errors import SceneError

from .field_errors import shown


def confined(name: str, folder: Path, source: object, field: str) -> Path:
    """The existing regular file `name`, relative to `folder`.

    Raises:
        SceneError: `name` is a URL or absolute, leaves the folder by ".." or by a symbolic link, or is no file.
    """
    windows = PureWindowsPath(name)
    if not name or "://" in name or windows.drive or windows.root or ".." in windows.parts:
        raise SceneError(source, field, "a path in the scene's folder or below", shown(name))
    try:
        root = folder.resolve()
        target = (root / name).resolve()
        if not target.is_relative_to(root):
            raise SceneError(source, field, "a path in the scene's folder or below", f"{shown(name)}, a link out of it")
        if not target.exists():
            raise SceneError(source, field, "an existing file", shown(name))
        if not target.is_file():
            raise SceneError(source, field, "a file", f"{shown(name)}, which is none")
    except SceneError:
        raise
    except (OSError, ValueError, RuntimeError):
        raise SceneError(source, field, "a readable file", shown(name)) from None
    return folder / name
