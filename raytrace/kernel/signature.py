"""The types of a kernel's arguments: as text for the list of kernels that a library is built of, and as its symbol.

A line of the list has the kernel's name and its arguments' types, such as raytrace.f |b1 <f8:2C ( None ): numbers and
arrays by NumPy's names, an array's with the number of its axes and C, F or A (any) for its layout, tuples in
brackets, after the type's name if they have one of their own. A callback's name has its path, `f@2@1`.
"""

from collections.abc import Iterator
from hashlib import sha256
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

_C, _FORTRAN, _ALIGNED = 0x1, 0x2, 0x100  # NumPy's flags
LAYOUT = _C | _FORTRAN | _ALIGNED
SIGNED = 1 << 63
_WORDS = {"b": "q", "i": "q", "u": "Q", "f": "d"}
_ENTRIES = 4  # of an example's axes


class Signature(NamedTuple):
    """A kernel and the types of its arguments."""

    line: str
    """As the list has it."""
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


def example(line: str) -> tuple[Any, tuple[int, ...], tuple[Any, ...]]:
    """What a line of the list stands for: the kernel, its path, and example arguments of its types.

    Raises: LookupError, AttributeError, ImportError, TypeError, ValueError: the sources have it no longer.
    """
    name, *texts = line.split()
    dotted_name, *path = name.split("@")
    return _named(dotted_name), tuple(map(int, path)), tuple(_values(iter(texts)))


def _named(name: str) -> Any:
    """The object with a dotted name, its module imported."""
    module, _, member = name.rpartition(".")
    return getattr(import_module(module), member)


def _values(texts: Iterator[str]) -> list[Any]:
    """Values of the types up to a closing bracket."""
    values: list[Any] = []
    for text in texts:
        if text == ")":
            break
        if text == "None":
            values.append(None)
        elif text == "(":
            values.append(tuple(_values(texts)))
        elif text.endswith("("):
            values.append(_named(text[:-1])(*_values(texts)))
        elif ":" in text:
            values.append(_array(*text.split(":")))
        else:
            values.append(np.dtype(text).type(1))
    return values


def _array(kind: str, layout: str) -> Any:
    """An example array of a dtype.

    Args: layout: number of axes and order, "2C" for instance; "A" is neither C nor F.
    """
    axes = int(layout[:-1])
    array = np.zeros((_ENTRIES,) * axes, kind, order="F" if layout[-1] == "F" else "C")
    return array[(slice(None, None, 2),) * axes] if layout[-1] == "A" else array
