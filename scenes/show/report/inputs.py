"""What a command read and how to run it again, for its report."""

from __future__ import annotations

import hashlib
import io
import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

_ON = ("reconstruct", "own_occlusion")  # switches that are on unless turned off
_NEITHER = ("shadows",)  # as the scene has it unless given
_LEFT_OUT = ("threads",)  # the result is the same


def hashed(files: Iterable[Path], contents: Mapping[Path, bytes | None] = {}) -> list[dict[str, Any]]:
    """Name, size in bytes and SHA-256 of files, each once. Args: contents: of those that are no files."""
    found = []
    for path in dict.fromkeys(files):
        content = contents.get(path)
        with path.open("rb") if content is None else io.BytesIO(content) as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            found.append({"path": str(path), "bytes": file.seek(0, io.SEEK_END), "sha256": digest})
    return found


def command_line(command: str, argument: str, options: Mapping[str, Any]) -> str:
    """The line for a shell that runs a command of `obscurance` with options by their names in its report."""
    words = ["obscurance", command, *_streamed(str(options[argument]), "--input-format")]
    for name, value in options.items():
        option = name.replace("_", "-")
        if name == argument or name in _LEFT_OUT or value is None:
            continue
        if not isinstance(value, bool):
            words += [f"--{option}", *_streamed(str(value), "--format")]
        elif value is False and name in (*_ON, *_NEITHER):
            words.append(f"--no-{option}")
        elif value is True and name not in _ON:
            words.append(f"--{option}")
    return shlex.join(words)


def _streamed(name: str, option: str) -> list[str]:
    """A file's name as words of a command; that of a standard stream, "<stdin>.ply" say, as "-" and its format."""
    stream, _, ending = name.rpartition(".")
    return ["-", option, ending] if stream in ("<stdin>", "<stdout>") else [name]
