"""The exceptions this project raises on purpose.

::

    ObscuranceError
    ├── InputError (ValueError)       the user's input is wrong: exit status 2
    │   ├── MeshError                 a mesh or mesh file
    │   ├── SceneError                a scene file
    │   ├── OptionError               an option or parameter value
    │   │   └── ConflictError         options that do not go together
    │   └── MemoryLimitError          work that does not fit into memory
    ├── OutputError (OSError)         a target that cannot be written: exit status 2
    ├── EmbreeError (RuntimeError)    Embree reported an error, is not version 4, or is missing
    ├── KernelError (RuntimeError)    kernels are missing that this machine could run
    └── ClusterError (RuntimeError)   a cluster is lost or cannot work

Every message is one line that says where, which field, what was expected and what came; or which options do not go
together.
"""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from .types import Float64s


class ObscuranceError(Exception):
    """Root of every exception raised on purpose."""


class InputError(ObscuranceError, ValueError):
    """Input the user can correct.

    Args:
        source: the file, option or object that holds the bad value.
        field: the part of it that is wrong.
        expected: what would have been accepted.
        got: what came instead.
        nearest: what was probably meant.
    """

    def __init__(self, source: object, field: str, expected: str, got: object, nearest: str | None = None) -> None:
        self.source, self.field, self.expected, self.got, self.nearest = str(source), field, expected, got, nearest
        text = f"{self.source}: {shortened(field)}: expected {shortened(expected, 1000)}, got {shortened(got)}"
        super().__init__(printable(f"{text}; did you mean {nearest}?" if nearest else text, LINE))

    def __reduce__(self) -> tuple[Any, ...]:
        return copyreg.__newobj__, (type(self), str(self)), {**vars(self), "got": str(self.got)}  # type: ignore[attr-defined]


def nearest_name(given: object, names: Iterable[str]) -> str | None:
    """The one of `names` that was probably meant by the unknown name `given`; None if half of it had to change."""
    from difflib import get_close_matches

    by_case = {name.lower(): name for name in names}
    word = str(given).lower()[:80]
    begun = [name for name in by_case if len(word) > 1 and name.startswith(word)]
    initials = [name for name in by_case if "".join(part[:1] for part in name.split("_")) == word]
    close = (name for name in get_close_matches(word, by_case, cutoff=0.5) if 2 * _edits(word, name) < len(word))
    near = initials or (begun if len(begun) == 1 else list(close))
    return by_case[near[0]] if near else None


def _edits(word: str, other: str) -> int:
    """How many letters have to be changed, put in or left out, or neighbours swapped (optimal string alignment)."""
    rows = [list(range(len(other) + 1))]
    for i, letter in enumerate(word):
        row = [i + 1]
        for j, own in enumerate(other):
            row.append(min(row[j] + 1, rows[i][j + 1] + 1, rows[i][j] + (letter != own)))
            if i and j and (letter, word[i - 1]) == (other[j - 1], own):
                row[j + 1] = min(row[j + 1], rows[i - 1][j - 1] + 1)
        rows.append(row)
    return rows[-1][-1]


def check_type(value: object, kind: type | tuple[type, ...], source: str, field: str, expected: str) -> None:
    """Refuse a `value` that is not of the type `kind`. Raises: OptionError."""
    if not isinstance(value, kind):
        raise OptionError(field, expected, repr(value), source)


def numbers(values: Any, source: str, field: str, expected: str) -> Float64s:
    """`values` as a float64 array. Raises: OptionError: they are no numbers."""
    import numpy as np  # so that mistakes and --help wait for no NumPy

    try:
        if np.iscomplexobj(values):
            raise ValueError
        return np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise OptionError(field, expected, repr(values), source) from None


def shortened(value: object, longest: int = 200) -> str:
    """A value's text, cut off after `longest` characters."""
    try:
        text = str(value)
    except RecursionError:
        return "deeply nested lists or tables"
    return text if len(text) <= longest else text[: longest - 1] + "…"


LINE = 1000
"""Characters of a message at most."""


def first_names(names: Sequence[str], most: int) -> str:
    """The first names of a list, `most` at most, and how many more there are, in words."""
    return ", ".join(names[:most]) + (f" and {len(names) - most:,} more" if len(names) > most else "")


def printable(text: str, longest: int | None = None) -> str:
    """The text on one line, with escapes for what moves a terminal's cursor or has no glyph.

    Args: longest: characters, if there is a limit; of a longer text the middle is left out.
    """
    if not text.isprintable():
        text = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)
    if longest and len(text) > longest:
        text = f"{text[: longest * 3 // 4]}…{text[1 - longest // 4 :]}"
    return text


def is_utf8(text: str) -> bool:
    """Whether UTF-8 can write the text: not if it is a file name of other bytes."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


class MeshError(InputError):
    """A mesh, or a file that should hold one, cannot be used."""


class SceneError(InputError):
    """A scene file cannot be used; `field` is the path to the value, such as `objects[2].material`."""


class OptionError(InputError):
    """A parameter is out of range or contradicts another."""

    def __init__(
        self, field: str, expected: str, got: object, source: object = "options", nearest: str | None = None
    ) -> None:
        super().__init__(source, field, expected, got, nearest)


Relation = Literal["needs", "excludes", "does not go with"]
Term = str | tuple[str, object]


class ConflictError(OptionError):
    """Options that need, exclude, or do not go with one another.

    Args:
        first, second: names of options, or pairs of a name and the value that matters; `second` also in words.
        relation: `first` to `second`. why: a clause, or nothing where it is plain.
    """

    def __init__(
        self, first: Term, relation: Relation, second: Term, source: object = "options", why: str = ""
    ) -> None:
        self.first, self.relation, self.second, self.why = first, relation, second, why
        super().__init__(first if isinstance(first, str) else first[0], "options that go together", "others", source)
        self.args = (printable(f"{self.source}: {self.in_words(_in_python)}", LINE),)

    def in_words(self, describe: Callable[[Term], str]) -> str:
        """The message. Args: describe: how an option, or a pair of an option and its value, is written."""
        option = describe(self.first)
        other = describe(self.second)
        excludes = self.relation == "excludes"
        pair = f"{option} and {other} exclude each other" if excludes else f"{option} {self.relation} {other}"
        return f"{pair}, {self.why}" if self.why else pair


def _in_python(term: Term) -> str:
    """An option, or a pair of an option and its value, as an argument in Python: `name=value`."""
    return term if isinstance(term, str) else f"{term[0]}={term[1]!r}"


class MemoryLimitError(InputError):
    """Work on this input takes more memory than there is; raised before it begins."""


class OutputError(ObscuranceError, OSError):
    """An output file cannot be written where it was asked for."""


class EmbreeError(ObscuranceError, RuntimeError):
    """Embree failed, and the message is its own; or there is no Embree, and the message says where to get it."""


class KernelError(ObscuranceError, RuntimeError):
    """There is no machine code of a kernel for this machine, and the message says how to build it, or for these types
    of arguments."""


class ClusterError(ObscuranceError, RuntimeError):
    """A cluster is lost, or none of its workers can be used."""
