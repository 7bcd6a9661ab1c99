"""JSON of a glTF file as typed records; what does not match is refused by name.

Not by pydantic: a small file is to be read in less time than it takes to load and to compile a schema (.1 s).
Whole numbers are indices and sizes, from 0; whether they point at something is found where they are used.
"""

from functools import cache
from types import UnionType
from typing import Annotated, Any, Literal, NoReturn, TypeVar, get_args, get_origin, get_type_hints

from raytrace.errors import MeshError
from raytrace.text.field_errors import joined, shown

T = TypeVar("T")
_Path = tuple[Any, ...]  # () for the whole, or the path of what holds a value, and its key or index there
_LARGEST, _PRECISE = 1e100, 2**53


class JsonObject:
    """A JSON object: attributes by the specification's names, whose defaults stand on the class; `vars`: the file's.

    `Annotated` says where below its record a value stands, if not under its attribute's name.
    """


class UnitNumber(float):
    """A number in [0, 1]."""


class _Fault(Exception):
    """Arguments: the path of a value, what was expected there, and what came."""


def parse(kind: type[T], value: Any, source: object) -> T:
    """`value` as `kind`. Raises: MeshError: the first value that is not of its type, by its path."""
    try:
        record: T = _read(kind, value, ())
        return record
    except _Fault as fault:
        path, expected, got = fault.args
        raise MeshError(source, _text(path) or "content", expected, got) from None


def _read(kind: Any, value: Any, path: _Path) -> Any:
    """A value as a type says, with all below it. Args: path: for messages. Raises: _Fault."""
    form, inner = _form(kind)
    if form is JsonObject:
        return None if value is None and len(inner) > 1 else _record(inner[0], value, path)
    # Lists and tables of values.
    if form is list or form is tuple:
        if not isinstance(value, list):
            _refuse(path, "a list", value)
        if form is tuple and len(value) > len(inner):
            raise _Fault(path, f"at most {len(inner)}", len(value))
        if form is tuple and len(value) < len(inner):
            raise _Fault((path, len(value)), "a value", "nothing")
        return form([_read(inner[0], entry, (path, number)) for number, entry in enumerate(value)])
    if form is dict:
        return {key: _read(inner[1], entry, (path, key)) for key, entry in _table(value, path).items()}
    # Single values.
    if form is Literal:
        return value if value in inner else _refuse(path, "one of " + ", ".join(inner), value)
    if form is int:
        if type(value) is not int or value >= _PRECISE:
            _refuse(path, "a whole number", value)
        return value if value >= 0 else _refuse(path, "greater than or equal to 0", value)
    if form is float or form is UnitNumber:
        if type(value) not in (int, float):
            _refuse(path, "a number", value)
        if form is float:
            return float(value) if abs(value) <= _LARGEST else _refuse(path, "a finite number", value)
        return float(value) if 0 <= value <= 1 else _refuse(path, "a number in [0, 1]", value)
    if form is str and not isinstance(value, str):
        _refuse(path, "a text", value)
    return value


def _record(kind: Any, value: Any, path: _Path) -> JsonObject:
    """An object as a `JsonObject` of this kind. Raises: _Fault."""
    record: JsonObject = kind()
    whole = _table(value, path)
    for name, inner, (*steps, key), is_required in _fields(kind):
        table = whole
        at = path
        for step in steps:
            at = at, step
            table = _table(table.get(step, {}), at)
        if key in table:
            setattr(record, name, _read(inner, table[key], (at, key)))
        elif is_required:
            raise _Fault((at, key), "a value", "nothing")
    return record


def _table(value: Any, path: _Path) -> dict[str, Any]:
    """The value, if it is a JSON object. Raises: _Fault."""
    return value if isinstance(value, dict) else _refuse(path, "an object", value)


@cache
def _form(kind: Any) -> tuple[Any, tuple[Any, ...]]:
    """What sort of type it is, and of what; JsonObject of a record, and of None too where that may stand for it."""
    inner = get_args(kind)
    if get_origin(kind) is UnionType:
        form, inner_kind = _form(inner[0])
        return form, inner if form is JsonObject else inner_kind
    if isinstance(kind, type) and issubclass(kind, JsonObject):
        return JsonObject, (kind,)
    return get_origin(kind) or kind, inner


@cache
def _fields(kind: Any) -> list[tuple[str, Any, list[str], bool]]:
    """A record's attributes: name, type, path below the record, and whether it must be there."""
    fields = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        inner, key = get_args(hint) if get_origin(hint) is Annotated else (hint, name)
        fields.append((name, inner, key.split("."), not hasattr(kind, name)))
    return fields


def _refuse(path: _Path, expected: str, got: object) -> NoReturn:
    """Refuse a value of another type than `expected`. Raises: _Fault."""
    raise _Fault(path, expected, shown(got))


def _text(path: _Path) -> str:
    """The path as text, such as `nodes[2].mesh`."""
    if not path:
        return ""
    return joined(_text(path[0]), f"[{path[1]}]" if isinstance(path[1], int) else path[1])
