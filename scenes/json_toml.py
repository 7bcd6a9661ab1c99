"""Values of JSON and TOML files: errors with the path of the value that is wrong, and JSON as RFC 8259 has it.

That knows neither NaN nor infinity; Python's own reader takes both.
"""

import json
import math
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

from obscurance.raytrace.errors import (
    LINE,
    ConflictError,
    InputError,
    OptionError,
    SceneError,
    nearest_name,
    printable,
    shortened,
)
from obscurance.raytrace.system.records import Words

_LONGEST = 100


def shown(value: object) -> str:
    """A value as a message shows it: on one line, strings in quotes, long ones cut short."""
    text = _one_line(value)
    return f'"{text}"' if isinstance(value, str) and not isinstance(value, Words) else text


def joined(path: str, field: str) -> str:
    """The path of a field within the table at `path`; "" is the whole file."""
    field = field if field.isprintable() else repr(field)
    return path + field if not path or not field or field.startswith("[") else f"{path}.{field}"


def check_keys(source: object, path: str, keys: Iterable[str], known: Collection[str]) -> None:
    """Check that all `keys` of the table at `path` are among the `known`. Raises: SceneError."""
    for key in keys:
        check_name(source, joined(path, key), key, known, "an unknown key")


def check_name(source: object, field: str, name: str, known: Collection[str], got: str | None = None) -> str:
    """The name. Raises: SceneError: it is not among the `known`."""
    if name not in known:
        raise SceneError(source, field, "one of " + ", ".join(known), got or shown(name), nearest_name(name, known))
    return name


@contextmanager
def located(source: object, path: str) -> Iterator[None]:
    """Errors raised within name the scene file `source` and the field's path, which starts with `path`."""
    try:
        yield
    except SceneError:
        raise
    except ConflictError as fault:
        error = SceneError(source, joined(path, fault.field), fault.expected, fault.got)
        sentence = fault.in_words(lambda term: term if isinstance(term, str) else f"{term[0]} = {shown(term[1])}")
        error.args = (printable(f"{source}: {joined(path, sentence)}", LINE),)
        raise error from None
    except OptionError as fault:
        got = _one_line(fault.got)
        raise SceneError(source, joined(path, fault.field), fault.expected, got, fault.nearest) from None
    except InputError as fault:
        field = f"{path}: {fault.source}: {fault.field}"
        raise SceneError(source, field, fault.expected, fault.got, fault.nearest) from None


def _one_line(value: object) -> str:
    """The text of a value, shortened, with its line breaks escaped."""
    return shortened(value, _LONGEST).replace("\n", "\\n").replace("\r", "\\r")


def parse_json(content: bytes | str) -> Any:
    """The value of a JSON text, UTF-8. Raises: ValueError: it is none. RecursionError: too many levels."""
    return json.loads(content, parse_constant=_refuse, parse_float=_finite)


def _refuse(name: str) -> NoReturn:
    """Refuse NaN and infinity, which Python's parser takes. Raises: ValueError."""
    raise ValueError(f"{name}, which is no number in JSON")


def _finite(text: str) -> float:
    """The value of a number in JSON. Raises: ValueError: it overflows."""
    value = float(text)
    if math.isinf(value):
        raise ValueError(f"{text}, which no double-precision number holds")
    return value
