"""A mesh on standard input: its bytes, and a name that says its format."""

import sys
from pathlib import Path

from raytrace.errors import MeshError, OptionError
from raytrace.system.checks import check_memory

from .load import PIPED, MeshFile, load
from .table import FORMATS, endings, sniffed_format

STANDARD = Path("-")
_CHUNK = 1 << 26
_SOURCE = "standard input"
_TRIANGLES, _TRIANGLE, _HEAD = slice(80, 84), 50, 84  # of a binary STL


def standard_input(format_: str | None) -> tuple[Path, bytes]:
    """The content of standard input, and a name with the ending of `format_`, or of the format by its first bytes.

    Raises: InputError: a terminal, nothing, what would not fit into memory, or first bytes that identify no format.
    """
    if sys.stdin.isatty():
        raise OptionError("mesh", "a mesh piped to standard input", "a terminal")
    content = bytearray()
    try:
        while chunk := sys.stdin.buffer.read(_CHUNK):
            content += chunk
            check_memory(_SOURCE, 2 * len(content), f"to read {len(content):,} bytes and more")
    except OSError as reason:  # it is closed
        raise MeshError(_SOURCE, "content", "a mesh", reason.strerror) from None
    if not content:
        raise MeshError(_SOURCE, "content", "a mesh", "nothing")
    return Path(f"{PIPED}.{format_ or _format_of(content)}"), bytes(content)


def load_mesh(path: Path) -> MeshFile:
    """A mesh file's content with its details, or standard input's for "-". Raises: as `load` and `standard_input`."""
    piped, content = standard_input(None) if path == STANDARD else (path, None)
    return load(piped, "described.glb", content)


def _format_of(content: bytes | bytearray) -> str:
    """Raises: MeshError: the first bytes identify no format."""
    if known := sniffed_format(content[:4096]):
        return known.removeprefix(".")
    if len(content) == _HEAD + _TRIANGLE * int.from_bytes(content[_TRIANGLES], "little"):
        return "stl"
    names = ", ".join(FORMATS[ending].name for ending in endings("begins"))
    raise MeshError(_SOURCE, "format", f"one of {names}, or --input-format", "another")
