"""JSON as RFC 8259 has it, which knows neither NaN nor infinity; Python's own reader takes both."""

import json
import math
from typing import Any, NoReturn


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
