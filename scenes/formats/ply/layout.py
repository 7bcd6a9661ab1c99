"""How a PLY file (Greg Turk, 1994) lays out its data: the header's elements, the rows of each, and columns by names."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.image.colour import encode_srgb
from obscurance.raytrace.mesh.mesh import UP
from obscurance.raytrace.types import AnyInts, Float32s

from ...asset.asset import Stored
from ...asset.material import Material, find_picture, picture
from ...asset.primitive import BAKED, COLOR, Column, ColumnSet, W, reverse_order

if TYPE_CHECKING:
    from obscurance.ao import Profile

NAMES = {
    "b": "char", "B": "uchar", "h": "short", "H": "ushort", "i": "int", "I": "uint", "f": "float", "d": "double",
    "q": "int64", "Q": "uint64",
}  # fmt: skip
"""The format's names of the types that NumPy calls by these letters."""
_TYPES = {name: letter for letter in NAMES for name in (NAMES[letter], np.dtype(letter).name)}
_ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
_CR = re.compile(rb"ply[ \t]*\r(?!\n)")
_END, _END_BY_CR = re.compile(rb"^end_header[ \t\r]*\n", re.MULTILINE), re.compile(rb"\rend_header[ \t]*\r")
INDICES = ("vertex_indices", "vertex_index")
COUNT = "number of "
UP_COMMENT = "comment up "  # of files of ours, and an axis
AXES = ("_x", "_y", "_z")  # behind the names of columns of vectors
PROFILE = f"{W}_"  # and two digits: columns of a profile
PROFILE_COMMENT = "comment obscurance profile: "  # of files of ours, the radius and the half-distances
RGB = ("red", "green", "blue")
OWN = "comment obscurance: "  # of files of ours, and what holds w
RECORD_COMMENT = "comment obscurance bake: "  # of files of ours, and how w was baked
_TEXTURE = "comment TextureFile "  # of MeshLab and others, and a name
UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_MESH = ("x", "y", "z", "nx", "ny", "nz")
_NO_VALUES = np.empty(0)


class Property(NamedTuple):
    """A column of an element of a PLY file."""

    name: str
    kind: str  # the type of its values
    values: npt.NDArray[Any]  # (n,), or the values of all lists one after the other
    counted: str = ""  # of lists, the type of their lengths
    sizes: npt.NDArray[Any] = np.empty(0, np.int64)  # (n,), of lists their lengths

    def fitting(self) -> Property:
        """Values in their own type if it holds them, or else in one that does."""
        kind = self.kind
        with np.errstate(all="ignore"):
            if self.values.dtype != np.dtype("<" + kind):
                cast = self.values.astype("<" + kind)
                if not np.array_equal(cast, self.values, equal_nan=kind in "fd"):
                    kind = "d"
            counted = self.counted
            if counted and not np.array_equal(self.sizes.astype("<" + counted), self.sizes):
                counted = "I"
        return self._replace(kind=kind, counted=counted)


@dataclass(eq=False)
class Element:
    """So many rows of some properties of a PLY file."""

    name: str
    count: int
    properties: tuple[Property, ...]

    @property
    def fitting(self) -> Element:
        """The element with all properties in types that hold their values."""
        return replace(self, properties=tuple(column.fitting() for column in self.properties))

    def others(self, *names: str | None) -> tuple[Property, ...]:
        """The properties but those of these names, and of a bake."""
        return tuple(one for one in self.properties if one.name not in names and not one.name.startswith(W))


class Ply(Stored):
    """A file as it is stored: all elements, and the comments that are no bake's."""

    def __init__(self, elements: Sequence[Element], comments: tuple[str, ...]) -> None:
        self.elements = tuple(elements)
        self.comments = tuple(line for line in comments if not line.startswith((OWN, PROFILE_COMMENT, RECORD_COMMENT)))
        records = (line.removeprefix(RECORD_COMMENT) for line in comments if line.startswith(RECORD_COMMENT))
        self.record = next(records, "")

    def reversed(self) -> Self:
        """The file with the corners of faces in reverse order, in all lists that have a value or a pair for each, and
        with normals negated."""
        face = columns_of(self.elements, "face", lists=True)
        sizes = next((face[name].sizes for name in INDICES if name in face), np.empty(0, np.int64))
        order = reverse_order(sizes)

        def turned(element: str, column: Property) -> Property:
            values = column.values
            if element == "vertex" and column.name in ("nx", "ny", "nz"):
                values = -values
            elif element == "face" and column.counted and len(values) in (len(order), 2 * len(order)):
                wide = len(values) // max(len(order), 1)
                if np.array_equal(column.sizes, wide * sizes):
                    values = values.reshape(-1, wide)[order].ravel()
            return column._replace(values=values)

        elements = [
            replace(element, properties=tuple(turned(element.name, column) for column in element.properties))
            for element in self.elements
        ]
        return type(self)(elements, self.comments)


def row_of(element: Element, lengths: Mapping[str, int], order: str = "<") -> np.dtype[Any]:
    """The type of a row, whose lists are of these lengths; the field `COUNT` + name has a list's length."""
    fields: list[tuple[Any, ...]] = []
    for column in element.properties:
        if column.counted:
            fields.append((COUNT + column.name, order + column.counted))
        fields.append((column.name, order + column.kind, *([(lengths[column.name],)] if column.counted else [])))
    return np.dtype(fields)


class PlyHeader(NamedTuple):
    """Attributes: text: whether the data are numbers in words. order: NumPy's sign of the bytes' order.
    elements: with at least one property, all without values. comments: lines, "comment …" or "obj_info …".
    start: of the data."""

    text: bool
    order: str
    elements: list[Element]
    comments: tuple[str, ...]
    start: int

    @property
    def up(self) -> str | None:
        """The axis that is up, which files written by this program name; None in others."""
        ups = [line.removeprefix(UP_COMMENT).rstrip() for line in self.comments if line.startswith(UP_COMMENT)]
        return ups[0] if ups and ups[0] in UP else None

    def profile(self, columns: Mapping[str, npt.NDArray[Any]]) -> Profile | None:
        """The profile that a bake has left. Args: columns: of the vertices."""
        for line in (line for line in self.comments if line.startswith(PROFILE_COMMENT)):
            numbers, _, limit = line.removeprefix(PROFILE_COMMENT).partition("max_distance")
            radius, *lengths = numbers.split() or ["0"]
            names = [f"{PROFILE}{number:02}" for number in range(len(lengths))]
            if names and set(names) <= set(columns):
                from obscurance.ao import Profile

                values = np.stack([columns[name] for name in names], axis=1)
                return Profile.stored(lengths, values, radius, limit.strip() or None)
        return None


def read_header(data: bytes) -> PlyHeader:
    """The header at the beginning of a file. Raises: ValueError, KeyError: it is none."""
    end = (_END_BY_CR if _CR.match(data) else _END).search(data)
    if data[:3] != b"ply" or not end:
        raise ValueError("no header of a PLY file")
    text = data[: end.start()].decode("latin-1").splitlines()
    lines = [line.split() for line in text]
    formats = [line[1] for line in lines if line[:1] == ["format"] and len(line) > 1]
    if len(formats) != 1 or formats[0] not in _ORDERS:
        raise ValueError("no format of a PLY file")
    comments = tuple(line.lstrip() for line in text if line.split()[:1] in (["comment"], ["obj_info"]))
    return PlyHeader(formats[0] == "ascii", _ORDERS[formats[0]], _elements(lines), comments, end.end())


def _elements(lines: list[list[str]]) -> list[Element]:
    """The elements that the lines of a header declare, without values. Raises: ValueError, KeyError."""
    elements: dict[str, tuple[int, dict[str, Property]]] = {}
    columns: dict[str, Property] = {}
    for words in lines:
        match words:
            case ["element", name, count]:
                columns = {}
                if name in elements or int(count) < 0:
                    raise ValueError(f"element {name} twice, or of a negative count")
                elements[name] = int(count), columns
            case ["property", *_, name] if name in columns:
                raise ValueError(f"property {name} twice")
            case ["property", "list", counted, kind, name]:
                columns[name] = Property(name, _TYPES[kind], _NO_VALUES, _TYPES[counted])
            case ["property", kind, name]:
                columns[name] = Property(name, _TYPES[kind], _NO_VALUES)
            case ["element" | "property", *_]:
                raise ValueError("the line " + " ".join(words))
    return [Element(name, count, tuple(columns.values())) for name, (count, columns) in elements.items() if columns]


def write_header(elements: Iterable[Element], comments: Iterable[str]) -> bytes:
    """The header of a binary little-endian file."""
    lines = ["ply", "format binary_little_endian 1.0", *comments]
    for element in elements:
        lines.append(f"element {element.name} {element.count}")
        for column in element.properties:
            counted = f"list {NAMES[column.counted]} " if column.counted else ""
            lines.append(f"property {counted}{NAMES[column.kind]} {column.name}")
    return "\n".join([*lines, "end_header\n"]).encode("latin-1", "replace")


def ply_columns(elements: Sequence[Element], sizes: AnyInts) -> ColumnSet:
    """Texture coordinates, colours and further values of vertices. Args: sizes: of the polygons."""
    vertex = columns_of(elements, "vertex")
    columns: dict[str, Column | Callable[[], Column]] = {}
    used = {*_MESH, *RGB, "alpha"}
    for pair in UV:
        if "uv0" not in columns and all(name in vertex and _finite(vertex[name]) for name in pair):
            columns["uv0"] = partial(_stacked, [vertex[name] for name in pair])
            used |= {*pair}
    wedges = columns_of(elements, "face", lists=True).get("texcoord")
    if "uv0" not in columns and wedges and _finite(wedges) and np.array_equal(wedges.sizes, 2 * sizes):
        columns["uv0"] = Column(wedges.values.reshape(-1, 2), np.arange(len(wedges.values) // 2))
    colours = stored_colors(elements)
    if set(RGB) <= set(colours):
        columns[COLOR] = partial(_colours, colours.values())
    for name in BAKED.values() if W in vertex else ():
        several = [vertex[name + axis] for axis in AXES if name + axis in vertex]
        if name in vertex or len(several) == len(AXES):
            columns[name] = Column(vertex[name].values) if name in vertex else partial(_stacked, several)
    further = {name: column for name, column in vertex.items() if name not in used and not name.startswith(W)}
    return ColumnSet(columns | {name: Column(column.values) for name, column in further.items()})


def ply_materials(comments: Iterable[str], folder: Path) -> tuple[Material, ...]:
    """A material for each texture that comments name, as MeshLab and others write them."""
    names = [line.removeprefix(_TEXTURE).strip() for line in comments if line.startswith(_TEXTURE)]
    return tuple(Material(name, texture=picture(find_picture(name, folder))) for name in names)


def _colours(columns: Iterable[Property]) -> Column:
    fractions = [column.values.astype(np.float64) / _largest(column.kind) for column in columns]
    return Column(np.stack(fractions, axis=1), srgb=True)


def _stacked(columns: Sequence[Property]) -> Column:
    return Column(np.stack([column.values for column in columns], axis=1))


def columns_of(elements: Sequence[Element], name: str, lists: bool = False) -> dict[str, Property]:
    """The properties of the element of this name that are single values, or `lists`."""
    columns = (column for element in elements if element.name == name for column in element.properties)
    return {column.name: column for column in columns if bool(column.counted) == lists}


def stored_colors(elements: Sequence[Element]) -> dict[str, Property]:
    """The vertices' properties red, green, blue and alpha, as far as there are any."""
    vertex = columns_of(elements, "vertex")
    return {name: vertex[name] for name in (*RGB, "alpha") if name in vertex}


def grey_of(w: npt.NDArray[Any]) -> Float32s:
    """Greys in [0, 255] that programs which take colours of a PLY for sRGB, as most do, read as w."""
    return np.rint(255 * encode_srgb(np.nan_to_num(w)))


def with_channel(w: npt.NDArray[Any], channel: str, stored: dict[str, Property]) -> list[Property]:
    """`stored_colors` with w, alpha linear, others sRGB-encoded, in the one that begins with the letter `channel`.

    It keeps its type; the others are as stored, or 1 where red, green or blue is missing.
    """
    name = next(name for name in (*RGB, "alpha") if name[0] == channel)
    kind = next((stored[column].kind for column in (name, *stored) if column in stored), "B")
    values = encode_srgb(np.nan_to_num(w)) if channel != "a" else np.clip(np.nan_to_num(w), 0, 1)
    levels = values.astype(kind) if kind in "fd" else np.rint(values * _largest(kind))
    white = {column: Property(column, kind, np.full(len(w), _largest(kind))) for column in RGB}
    return [*(white | stored | {name: Property(name, kind, levels)}).values()]


def _finite(column: Property) -> bool:
    return bool(np.isfinite(column.values).all())


def _largest(kind: str) -> float:
    """What 1 is stored as in a colour of this type."""
    return 1.0 if kind in "fd" else float(np.iinfo(kind).max)
