"""A check of files to read: each must exist and be a regular file."""

import stat
from pathlib import Path

from ..errors import InputError


def check_regular(path: Path, kind: str, fault: type[InputError] = InputError, source: str | None = None) -> None:
    """Refuse a path to anything but a regular file.

    Args:
        path: symbolic links are followed. kind: what the message expects, such as "an image file".
        fault: the class to raise. source: what the message calls the file; by default `path`.

    Raises:
        InputError: of the class `fault`: there is no such file, or it is a folder, a device or a pipe.
        OSError: the system does not let it be looked at.
    """
    name = str(path) if source is None else source
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, ValueError):  # the latter of a name with a null byte
        raise fault(name, "file", "an existing file", "none") from None
    if stat.S_ISDIR(mode):
        raise fault(name, "file", kind, "a folder")
    if not stat.S_ISREG(mode):
        raise fault(name, "file", kind, "something that is not a regular file")
