"""Faults that pydantic finds in plain values, in this project's words: where, what was expected, what came."""

import re
from collections.abc import Callable, Iterable
from types import NoneType, UnionType
from typing import Any, NamedTuple, Union, get_args, get_origin

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from ..errors import nearest_name


class Fault(NamedTuple):
    """A fault in plain values: its path, the expected and the given value, and the name that was probably meant."""

    path: str
    expected: str
    got: Any
    nearest: str | None


_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
_BOUNDS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")
_EXPECTATIONS = {
    "bool_type": "true or false",
    "dict_type": "a table",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "list_type": "a list",
    "model_attributes_type": "a table",
    "model_type": "a table",
    "multiple_argument_values": "one value",
    "string_type": "a text",
    "tuple_type": "a list of numbers",
}


def most_telling(error: ValidationError) -> ErrorDetails:
    """The most useful fault: an unknown name before a missing one, which it may be."""
    faults = error.errors(include_url=False)
    unknown = (fault for fault in faults if fault["type"] in _UNKNOWN)
    return next(unknown, faults[0]) if faults[0]["type"] == "missing" else faults[0]


def first_fault(error: ValidationError, kind: type, show: Callable[[Any], Any] = lambda value: value) -> Fault:
    """The most useful fault of a validation. Args: kind: what was validated. show: text of a value that came."""
    fault = most_telling(error)
    location = fault["loc"]
    came = fault["input"]
    path = path_of(location)
    if fault["type"] in _UNKNOWN:
        names = list(fields_of(declared(kind, location[:-1]).annotation))
        return Fault(path, "one of " + ", ".join(names), "an unknown key", nearest_name(location[-1], names))
    if fault["type"] == "missing":
        return Fault(path, declared(kind, location).description or "a value", "nothing", None)
    if fault["type"] == "too_short":
        least = fault["ctx"]["min_length"]
        return Fault(path, f"at least {'one' if least == 1 else least}", len(came) or "none", None)
    if fault["type"] == "too_long":
        return Fault(path, f"at most {fault['ctx']['max_length']}", len(came), None)
    if fault["type"] == "literal_error":
        texts = [choice for choice in get_args(declared(kind, location).annotation) if isinstance(choice, str)]
        if len(texts) > 2:
            return Fault(path, "one of " + ", ".join(texts), show(came), nearest_name(came, texts))
        return Fault(path, fault["ctx"]["expected"], show(came), nearest_name(came, texts))
    return Fault(path, _expected(fault, declared(kind, location)), show(came), None)


def path_of(location: Iterable[str | int]) -> str:
    """Names and indices as a path, `objects[2].material`; names that cannot be printed in quotes."""
    names = (part if isinstance(part, int) or part.isprintable() else repr(part) for part in location)
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in names).removeprefix(".")


def fields_of(kind: Any) -> dict[str, FieldInfo]:
    """The fields of a pydantic class by name; none of any other type."""
    return getattr(kind, "__pydantic_fields__", {})


def declared(kind: Any, location: Iterable[str | int]) -> FieldInfo:
    """What `kind` says of the value at a fault's location, through fields, lists, tuples and what may be None."""
    field = _required(FieldInfo.from_annotation(kind))
    for part in location:
        within = get_args(field.annotation)
        if isinstance(part, str):
            field = fields_of(field.annotation).get(part, _ANYTHING)
        else:
            field = FieldInfo.from_annotation(within[min(part, len(within) - 1)]) if within else _ANYTHING
        field = _required(field)
    return field


_ANYTHING = FieldInfo.from_annotation(Any)


def _required(declared: FieldInfo) -> FieldInfo:
    """The declared type without None."""
    others = [kind for kind in get_args(declared.annotation) if kind is not NoneType]
    optional = get_origin(declared.annotation) in (Union, UnionType) and len(others) == 1
    return FieldInfo.from_annotation(others[0]) if optional else declared


def _expected(fault: ErrorDetails, declared: FieldInfo) -> str:
    """The expected value, in a few words."""
    names = ("ge", "gt", "le", "lt")
    bounds = {
        name: getattr(constraint, name)
        for constraint in declared.metadata
        for name in names
        if hasattr(constraint, name)
    }
    if declared.annotation is int and {"ge", "le"} <= set(bounds):
        return f"a whole number from {bounds['ge']} to {bounds['le']}"
    if declared.annotation is float and fault["type"] in _BOUNDS and len(bounds) == 2:
        low, high = sorted(bounds, key=names.index)
        interval = f"{'[' if low == 'ge' else '('}{bounds[low]:g}, {bounds[high]:g}{']' if high == 'le' else ')'}"
        return "a number in " + re.sub(r"e([-+])0*", lambda sign: "e" + sign[1].strip("+"), interval)
    if fault["type"] == "union_tag_invalid":
        return f"one of {fault['ctx']['expected_tags']}"
    message = fault["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return _EXPECTATIONS.get(fault["type"], message[:1].lower() + message[1:])
