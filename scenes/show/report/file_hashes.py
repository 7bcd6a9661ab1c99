"""The inputs of a command, for its report."""

import hashlib
import io
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any


def hashed(files: Iterable[Path], contents: Mapping[Path, bytes | None] = {}) -> list[dict[str, Any]]:
    """Name, size in bytes and SHA-256 of files, each once. Args: contents: of inputs that are no files."""
    rows = []
    for path in dict.fromkeys(files):
        content = contents.get(path)
        with path.open("rb") if content is None else io.BytesIO(content) as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
            rows.append({"path": str(path), "bytes": file.seek(0, io.SEEK_END), "sha256": digest})
    return rows
