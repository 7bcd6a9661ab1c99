"""How a PLY file lays out its data: the header's elements, and the rows of each.

Format: Greg Turk, The PLY polygon file format, 1994.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from raytrace.mesh.up import UP

if TYPE_CHECKING:
    from ao import Profile

NAMES = {
    "b": "char", "B": "uchar", "h": "short", "H": "ushort", "i": "int", "I": "uint", "f": "float", "d": "double",
    "q": "int64", "Q": "uint64",
}  # fmt: skip
"""The format's names of the types that NumPy calls by these letters."""
_TYPES = {name: letter for letter, name in NAMES.items()} | {
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d",
}  # fmt: skip
_ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
_END = re.compile(rb"^end_header[ \t\r]*\n", re.MULTILINE)
INDICES = ("vertex_indices", "vertex_index")
COUNT = "number of "
UP_COMMENT = "comment up "  # of files of ours, and an axis
PROFILE = "obscurance_"  # and two digits: columns of a profile
PROFILE_COMMENT = "comment obscurance profile: "  # of files of ours, the radius and the half-distances


@dataclass
class PlyElement:
    """An element as a header declares it."""

    name: str
    count: int
    # by name the type of the values, and of the length of a list or "" for a single value
    properties: dict[str, tuple[str, str]] = field(default_factory=dict)

    def row(self, lengths: Mapping[str, int], order: str = "<") -> np.dtype[Any]:
        """The type of a row, whose lists are of these lengths; the field `COUNT` + name has a list's length."""
        fields: list[tuple[Any, ...]] = []
        for name, (kind, counted) in self.properties.items():
            if counted:
                fields.append((COUNT + name, order + counted))
            fields.append((name, order + kind, *([(lengths[name],)] if counted else [])))
        return np.dtype(fields)


class PlyHeader(NamedTuple):
    """Attributes: text: whether the data are numbers in words. order: NumPy's sign of the bytes' order.
    elements: with at least one property. comments: lines, "comment …" or "obj_info …". start: of the data."""

    text: bool
    order: str
    elements: list[PlyElement]
    comments: tuple[str, ...]
    start: int

    @property
    def up(self) -> str | None:
        """The axis that is up, of files of ours."""
        ups = [line.removeprefix(UP_COMMENT) for line in self.comments if line.startswith(UP_COMMENT)]
        return ups[0] if ups and ups[0] in UP else None

    def profile(self, columns: Mapping[str, npt.NDArray[Any]]) -> Profile | None:
        """The profile that a bake has left. Args: columns: of the vertices."""
        for line in (line for line in self.comments if line.startswith(PROFILE_COMMENT)):
            radius, *lengths = line.removeprefix(PROFILE_COMMENT).split() or ["0"]
            names = [f"{PROFILE}{number:02}" for number in range(len(lengths))]
            if names and set(names) <= set(columns):
                from ao import Profile

                return Profile.stored(lengths, np.stack([columns[name] for name in names], axis=1), radius)
        return None


def read_header(data: bytes) -> PlyHeader:
    """The header at the beginning of a file. Raises: ValueError, KeyError: it is none."""
    end = _END.search(data)
    if data[:3] != b"ply" or not end:
        raise ValueError("no header of a PLY file")
    lines = [line.split() for line in data[: end.start()].decode("latin-1").splitlines()]
    formats = [line[1] for line in lines if line[:1] == ["format"] and len(line) > 1]
    if len(formats) != 1 or formats[0] not in _ORDERS:
        raise ValueError("no format of a PLY file")
    comments = tuple(" ".join(line) for line in lines if line[:1] in (["comment"], ["obj_info"]))
    return PlyHeader(formats[0] == "ascii", _ORDERS[formats[0]], _elements(lines), comments, end.end())


def _elements(lines: list[list[str]]) -> list[PlyElement]:
    made: dict[str, PlyElement] = {}
    last = PlyElement("", 0)
    for words in lines:
        match words:
            case ["element", name, count]:
                last = PlyElement(name, int(count))
                if made.setdefault(name, last) is not last or last.count < 0:
                    raise ValueError(f"element {name} twice, or of a negative count")
                continue
            case ["property", "list", counted, kind, name]:
                types = _TYPES[kind], _TYPES[counted]
            case ["property", kind, name]:
                types = _TYPES[kind], ""
            case ["element" | "property", *_]:
                raise ValueError("the line " + " ".join(words))
            case _:
                continue
        if last.properties.setdefault(name, types) is not types:
            raise ValueError(f"property {name} twice")
    return [element for element in made.values() if element.properties]


def write_header(elements: Iterable[PlyElement], comments: Iterable[str]) -> bytes:
    """The header of a binary little-endian file."""
    lines = ["ply", "format binary_little_endian 1.0", *comments]
    for element in elements:
        lines.append(f"element {element.name} {element.count}")
        for name, (kind, counted) in element.properties.items():
            lines.append(f"property {f'list {NAMES[counted]} ' if counted else ''}{NAMES[kind]} {name}")
    return "\n".join([*lines, "end_header\n"]).encode("latin-1", "replace")
