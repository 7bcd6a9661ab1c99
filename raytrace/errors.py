"""The exceptions this project raises on purpose.

::

    ObscuranceError
    ├── InputError (ValueError)       the user's input is wrong: exit status 2
    │   ├── MeshError                 a mesh or mesh file
    │   ├── SceneError                a scene file
    │   ├── OptionError               an option or parameter value
    │   └── MemoryLimitError          work that does not fit into memory
    ├── OutputError (OSError)         a target that cannot be written: exit status 2
    └── EmbreeError (RuntimeError)    Embree reported an error, or is not version 4

Every message is one line that says where, which field, what was expected and what came.
"""

from __future__ import annotations


class ObscuranceError(Exception):
    """Root of every exception raised on purpose."""


class InputError(ObscuranceError, ValueError):
    """Input the user can correct.

    Args:
        source: the file, option or object that holds the bad value.
        field: the part of it that is wrong.
        expected: what would have been accepted.
        got: what came instead.
    """

    def __init__(self, source: object, field: str, expected: str, got: object) -> None:
        self.source, self.field, self.expected, self.got = str(source), field, expected, got
        text = f"{self.source}: {shortened(field)}: expected {shortened(expected, 1000)}, got {shortened(got)}"
        super().__init__(printable(text))


def shortened(value: object, longest: int = 200) -> str:
    """A value's text, the end of a long one left out."""
    try:
        text = str(value)
    except RecursionError:
        return "deeply nested lists or tables"
    return text if len(text) <= longest else text[: longest - 1] + "…"


def printable(text: str) -> str:
    """The text on one line, with escapes for what moves a terminal's cursor or has no glyph."""
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class MeshError(InputError):
    """A mesh, or a file that should hold one, cannot be used."""


class SceneError(InputError):
    """A scene file cannot be used; `field` is the path to the value, such as `objects[2].material`."""


class OptionError(InputError):
    """A parameter is out of range or contradicts another."""

    def __init__(self, field: str, expected: str, got: object, source: object = "options") -> None:
        super().__init__(source, field, expected, got)


class MemoryLimitError(InputError):
    """Work on this input takes more memory than there is; raised before it begins."""


class OutputError(ObscuranceError, OSError):
    """An output file cannot be written where it was asked for."""


class EmbreeError(ObscuranceError, RuntimeError):
    """Embree failed; the message is Embree's own."""
