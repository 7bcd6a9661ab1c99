"""The types of a kernel's arguments: as a line of text, and as the symbol of its machine code.

A line has the kernel's name and its arguments' types, such as raytrace.f |b1 <f8:2C ( None ): numbers and
arrays by NumPy's names, an array's with the number of its axes and C, F or A (any) for its layout, tuples in
brackets, after the type's name if they have one of their own. A callback's name has its path, `f@2@1`.
"""

from collections.abc import Iterator
from hashlib import sha256
from typing import Any, NamedTuple

import numpy as np

_C, _FORTRAN, _ALIGNED = 0x1, 0x2, 0x100  # NumPy's flags
LAYOUT = _C | _FORTRAN | _ALIGNED
SIGNED = 1 << 63
_WORDS = {"b": "q", "i": "q", "u": "Q", "f": "d"}


class Signature(NamedTuple):
    """A kernel and the types of its arguments."""

    line: str
    """The name and the types as text."""
    symbol: str
    """The name of its machine code, which depends on names of tuples' members, too."""
    words: str
    """The format of the words that its machine code takes, as `struct` has it."""
    path: tuple[int, ...]
    """Of a `Kernel.callback`."""

    @classmethod
    def of(cls, name: str, key: tuple[Any, ...], path: tuple[int, ...]) -> "Signature":
        """The signature of a kernel of this name and path.

        Args: key: the types in order, as `raytrace.kernel.jit` lists them: of a number its type; of an array its dtype,
            axes and flags; of a tuple its type, how many members it has, and theirs.

        Raises: TypeError: something else among them.
        """
        kinds = iter(key)
        texts = ["@".join((name, *map(str, path)))]
        members: list[str] = []
        words = ""
        while (kind := next(kinds, None)) is not None:
            words += _describe(kind, kinds, texts, members)
        line = " ".join(texts)
        hashed = sha256("\0".join((line, *members)).encode()).hexdigest()[:16]
        return cls(line, f"{name.replace('.', '_')}_{hashed}", words, path)


def _describe(kind: Any, kinds: Iterator[Any], texts: list[str], members: list[str]) -> str:
    """Append the text of the next of `kinds`, and the names of a tuple's `members`; returns the format of its words."""
    if isinstance(kind, np.dtype):
        axes = next(kinds)
        flags = next(kinds)
        layout = "C" if flags & _C else "F" if flags & _FORTRAN else "A"
        unaligned = "" if flags & _ALIGNED else "-unaligned"
        texts.append(f"{_name(kind)}:{axes}{layout}{unaligned}")
        return "P"
    if issubclass(kind, tuple):
        texts.append("(" if kind is tuple else f"{kind.__module__}.{kind.__qualname__}(")
        members.extend(getattr(kind, "_fields", ()))
        inner = [_describe(next(kinds), kinds, texts, members) for _ in range(next(kinds))]
        texts.append(")")
        return "".join(inner)
    if kind is type(None):
        texts.append("None")
        return ""
    number = np.dtype(kind)
    if number.kind not in _WORDS:
        raise TypeError(f"argument of a kernel: expected arrays, numbers and tuples of them, got {kind}")
    texts.append(number.str)
    return _WORDS[number.kind]


def _name(kind: np.dtype[Any]) -> str:
    """The text of a dtype in a signature."""
    return kind.str if kind.names is None else repr(kind).replace(" ", "")
