"""Values checked by the types of the fields that hold them: parameters in Python, tables of TOML, objects of JSON.

    class Node(Record):                     # of a file: `vars` are what the file has, defaults stand on the class
        mesh: int | None = None
        weight: Annotated[float, Within(0, 1)] = 1.0

    read(Node, {"mesh": "a"})               # Fault: mesh: expected a whole number, got "a"

A type may be `Annotated` with bounds (`Within`); with functions that check or make a value and raise ValueError with
what they expect, or `Before` for one that comes first; with a text, which is expected in place of all that; and with
`Words`, which are expected where there is no value. `At` says where below its table a value stands.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from functools import cache
from math import inf
from types import FunctionType, NoneType, UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    NamedTuple,
    NoReturn,
    ParamSpec,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)  # fmt: skip

from ..errors import nearest_name

P = ParamSpec("P")
T = TypeVar("T")
Read = Callable[[Any], Any]
_MISSING: Any = object()


class Words(str):
    """Words of a message in place of a value, such as "nothing"; shown without quotes."""


class Fault(Exception):
    """A value that is not of its type: what was expected, what came, the name that was probably meant, the path."""

    def __init__(self, expected: str, got: Any, nearest: str | None = None, path: tuple[str | int, ...] = ()) -> None:
        super().__init__(expected, got)
        self.expected, self.got, self.nearest, self.path = expected, got, nearest, path

    @property
    def place(self) -> str:
        """The path as text, `objects[2].material`; names that cannot be printed in quotes."""
        names = (part if isinstance(part, int) or part.isprintable() else repr(part) for part in self.path)
        return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in names).removeprefix(".")


class Within(NamedTuple):
    """Bounds of a number. `ends`: "(" and ")" where a bound itself is excluded. `words`: what is expected, if given."""

    least: float
    most: float = inf
    ends: str = "[]"
    words: str = ""

    def __contains__(self, number: Any) -> bool:
        inside: bool = self.least < number < self.most
        return inside or (number == self.least and "[" in self.ends) or (number == self.most and "]" in self.ends)

    def of(self, kind: type) -> str:
        """The numbers of a type within the bounds, in words."""
        if self.words:
            return self.words
        if kind is int:
            return f"a whole number from {self.least} to {self.most}"
        low, high = (f"{bound:g}".replace("e+", "e").replace("e0", "e").replace("e-0", "e-") for bound in self[:2])
        return f"a number in {self.ends[0]}{low}, {high}{self.ends[1]}"


_ANY = {float: Within(-inf, inf, "()", "a finite number"), int: Within(-inf, inf, "()", "a whole number")}


class Before(NamedTuple):
    """A function that is applied to a value before it is read."""

    make: Read


class At(NamedTuple):
    """Where below its table a value stands: "perspective.yfov"."""

    path: str


class Record:
    """A table of a file. `vars` are the values that it has; defaults stand on the class.

    None, null in JSON, stands for a record alone, not for a number or a text that may be left out.
    """

    table: ClassVar[str] = "an object"  # what the file's format calls it
    unknown: ClassVar[str] = "ignore"  # what becomes of other keys: "ignore", "refuse", or "keep" in `extra`
    extra: ClassVar[Mapping[str, Any]] = {}


class Field(NamedTuple):
    """A field of a class, with its checks."""

    steps: list[str]  # from the table of the record to that of the value
    key: str
    read: Read
    default: Any
    wanted: str  # what is expected where there is none


def _cached(function: Callable[P, T]) -> Callable[P, T]:
    """`cache`, of which mypy knows the parameters."""
    cached: Callable[P, T] = cache(function)  # type: ignore[assignment]
    return cached


def read(kind: type[T], value: Any) -> T:
    """A plain value as one of a type. Raises: Fault."""
    made: T = reader(kind)(value)
    return made


@_cached
def fields_of(kind: type) -> dict[str, Field]:
    """The fields of a class by name, as its annotations have them."""
    owner = kind if issubclass(kind, Record) else None
    fields = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        if ClassVar in (hint, get_origin(hint)):
            continue
        notes = getattr(hint, "__metadata__", ())
        *steps, key = next((note.path for note in notes if isinstance(note, At)), name).split(".")
        wanted = next((note for note in notes if isinstance(note, str)), "a value")
        fields[name] = Field(steps, key, reader(hint, owner), getattr(kind, name, _MISSING), wanted)
    return fields


def read_fields(kind: type, table: Mapping[str, Any], unknown: str = "refuse") -> dict[str, Any]:
    """The fields of a class that a table has. Raises: Fault: a name is unknown, or a value wrong or missing."""
    fields = fields_of(kind)
    if unknown == "refuse":
        for key in table:
            if key not in fields:
                raise Fault("one of " + ", ".join(fields), Words("an unknown key"), nearest_name(key, fields), (key,))
    values = {}
    for name, field in fields.items():
        within = table
        for depth, step in enumerate(field.steps):
            within = within.get(step, {})
            if not isinstance(within, dict):
                raise Fault("an object", within, path=tuple(field.steps[: depth + 1]))
        value = within.get(field.key, _MISSING)
        try:
            if value is not _MISSING:
                values[name] = field.read(value)
            elif field.default is _MISSING:
                raise Fault(field.wanted, Words("nothing"))
        except Fault as fault:
            fault.path = (*field.steps, field.key, *fault.path)
            raise
    return values


@_cached
def reader(kind: Any, owner: type[Record] | None = None) -> Read:
    """The function that checks values of a type and makes them plain, and raises Fault. Args: owner: of the field."""
    form, inner = get_origin(kind), get_args(kind)
    if form is Annotated:
        return _annotated(inner[0], kind.__metadata__, owner)
    if form in (Union, UnionType):
        return _optional(inner, owner)
    if form is Literal:
        return _choice(inner)
    if form is dict:
        return _table(reader(inner[1], owner), owner.table if owner else "a table")
    if form is list:
        return _items(list, reader(inner[0], owner), "a list", None)
    if form is tuple:  # all of whose items are of one type
        length = None if inner[-1] is ... else len(inner)
        return _items(tuple, reader(inner[0], owner), "a list of numbers", length)
    if isinstance(kind, type) and (issubclass(kind, Record | tuple) or is_dataclass(kind)):
        return _record(kind)
    if kind in _ANY:
        return _number(kind, _ANY[kind])
    return {bool: _switch, str: _text}.get(kind, _anything)


def _annotated(kind: Any, notes: tuple[Any, ...], owner: type[Record] | None) -> Read:
    """The reader of a type with bounds, functions and words."""
    before = [note.make for note in notes if isinstance(note, Before)]
    bounds = [_number(kind, note) for note in notes if isinstance(note, Within)]
    after = [note for note in notes if isinstance(note, FunctionType)]
    words = next((note for note in notes if type(note) is str), None)
    steps: list[Read] = [*before, *(bounds or [reader(kind, owner)]), *after]

    def annotated(value: Any) -> Any:
        made = value
        try:
            for step in steps:
                made = step(made)
        except ValueError as fault:
            raise Fault(words or str(fault), value) from None
        except Fault:
            if words is None:
                raise
            raise Fault(words, Words(repr(value)) if isinstance(value, str) else value) from None
        return made

    return annotated


def _optional(kinds: tuple[Any, ...], owner: type[Record] | None) -> Read:
    """The reader of a type or None; of several types it takes anything, which a function has to check."""
    others = [kind for kind in kinds if kind is not NoneType]
    if len(others) > 1:
        return _anything
    given = reader(others[0], owner)
    if owner and not (isinstance(others[0], type) and issubclass(others[0], Record)):
        return given
    return lambda value: None if value is None else given(value)


def _choice(names: tuple[str, ...]) -> Read:
    """The reader of one of some names."""

    def choice(value: Any) -> str:
        name = plain(value)
        if name not in names:
            raise Fault("one of " + ", ".join(names), value, nearest_name(value, names))
        return str(name)

    return choice


def _number(kind: type, bounds: Within) -> Read:
    """The reader of numbers of a type within bounds."""
    types = (int,) if kind is int else (int, float)
    within = bounds.of(kind)
    expected = within if kind is int else "a number"

    def number(value: Any) -> float:
        given = plain(value)
        if not isinstance(given, types) or isinstance(given, bool):
            _refuse(expected, Words(f'"{value}"') if isinstance(value, str) else value)
        try:
            made: float = kind(given)
        except OverflowError:
            _refuse(within, value)
        return made if made in bounds else _refuse(within, value)

    return number


def _items(form: type, item: Read, expected: str, length: int | None) -> Read:
    """The reader of a list or a tuple. Args: length: how many items there have to be."""

    def items(value: Any) -> Any:
        given = plain(value)
        if not isinstance(given, Sequence) or isinstance(given, str | bytes):
            _refuse(expected, value)
        if length is not None and len(given) > length:
            _refuse(f"at most {length}", len(given))
        made: list[Any] = []
        try:
            for entry in given:
                made.append(item(entry))
            if length is not None and len(made) < length:
                _refuse("a value", Words("nothing"))
        except Fault as fault:
            fault.path = (len(made), *fault.path)
            raise
        return form(made)

    return items


def _table(item: Read, expected: str) -> Read:
    """The reader of a table of any names."""

    def table(value: Any) -> dict[str, Any]:
        if not isinstance(value, dict):
            _refuse(expected, value)
        made = {}
        for key, entry in value.items():
            try:
                made[key] = item(entry)
            except Fault as fault:
                fault.path = (key, *fault.path)
                raise
        return made

    return table


def _record(kind: type) -> Read:
    """The reader of a record, a dataclass or a named tuple."""
    name = getattr(kind, "table", "a table")
    unknown = getattr(kind, "unknown", "ignore")

    def record(value: Any) -> Any:
        if not isinstance(value, dict):
            _refuse(name, value)
        values = read_fields(kind, value, unknown)
        if not issubclass(kind, Record):
            return kind(**values)
        made = kind()
        vars(made).update(values)
        if unknown == "keep":
            vars(made)["extra"] = {key: entry for key, entry in value.items() if key not in values}
        return made

    return record


def plain(value: Any) -> Any:
    """An array as lists, one of NumPy's numbers as a plain one; others as they are."""
    return value.tolist() if hasattr(value, "tolist") else value


def _switch(value: Any) -> bool:
    given = plain(value)
    return given if isinstance(given, bool) else _refuse("true or false", value)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else _refuse("a text", value)


def _anything(value: Any) -> Any:
    return value


def _refuse(expected: str, got: Any) -> NoReturn:
    """Refuse a value. Raises: Fault."""
    raise Fault(expected, got)
