"""Validated, immutable parameter classes, and the types of their fields.

A wrong value raises `OptionError`, which names the class, the field, the accepted range and the value.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from inspect import Parameter, Signature
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from ..errors import OptionError, nearest_name


def _triple(value: Any) -> Any:
    """A single number stands for three equal ones; arrays become tuples."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, int | float) and not isinstance(value, bool):
        return (value, value, value)
    return value


def _direction(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if value == (0.0, 0.0, 0.0):
        raise ValueError("a vector other than zero")
    return value


def _side(value: Any) -> Any:
    if not isinstance(value, bool) and value != "viewer":
        raise ValueError('true, false or "viewer"')
    return value


def _vector(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


def within(interval: str, expected: str | None = None) -> AfterValidator:
    """Accepts a float in an interval written as mathematicians do, such as "[0, 1)"; never NaN.

    Args: expected: what a message calls it.
    """
    low, high = (float(bound) for bound in interval[1:-1].split(","))

    def check(value: float) -> float:
        above = value > low or (value == low and interval[0] == "[")
        below = value < high or (value == high and interval[-1] == "]")
        if not (above and below):
            raise ValueError(expected or f"a number in {interval}")
        return value

    return AfterValidator(check)


Real = Annotated[float, Field(allow_inf_nan=False)]
Fraction = Annotated[float, within("[0, 1]")]
Positive = Annotated[float, within("(0, inf)")]
NonNegative = Annotated[float, within("[0, inf)")]
Length = Annotated[float, within("[1e-100, 1e100]")]  # products of a few neither vanish nor overflow
Slope = Annotated[float, within("[1e-6, 100]")]
Index = Annotated[float, within("[1, 1e6]")]
Exponent = Annotated[float, within("(0, 1e6]")]
Smoothness = Annotated[float, within("[0, 1)")]
Spacing = Annotated[float, within("[1e-3, 1e6]")]
Angle = Annotated[float, within("[0, 1.5707963267948966]", "radians in [0, π/2]")]
HalfAngle = Annotated[float, within("(0, 90]", "degrees in (0, 90]")]

Reflectance = Annotated[tuple[Fraction, Fraction, Fraction], BeforeValidator(_triple)]
Radiance = Annotated[tuple[NonNegative, NonNegative, NonNegative], BeforeValidator(_triple)]
Indices = Annotated[tuple[Index, Index, Index], BeforeValidator(_triple)]
Point = Annotated[tuple[Real, Real, Real], BeforeValidator(_vector)]
Direction = Annotated[Point, AfterValidator(_direction)]
Sides = Annotated[bool | Literal["viewer"], BeforeValidator(_side)]


class Parameters(BaseModel):
    """Base of materials and lights: frozen, no unknown fields, errors as `OptionError`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        cls.__signature__ = _signature(cls)

    def __init__(self, *unnamed: Any, **data: Any) -> None:
        if unnamed:
            kind = type(self).__name__
            example = f"{kind}({next(iter(type(self).__signature__.parameters))}=…)"
            raise OptionError("values", f"each by its name, as in {example}", ", ".join(map(repr, unnamed)), kind)
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise option_error(error, type(self).__name__, type(self).model_fields) from None

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, strings and lists, ready for a TOML scene: the tag, and what differs from the defaults."""
        tag = {name: getattr(self, name) for name in ("model", "light") if name in type(self).model_fields}
        return tag | self.model_dump(mode="json", exclude_defaults=True, exclude_none=True)


class _Written(str):
    """An annotation as the source has it, without quotes."""

    def __repr__(self) -> str:
        return str(self)


def _signature(cls: type[BaseModel]) -> Signature:
    """What may be given, needed values first, by the names of their types in this module, for `help`."""
    written: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        written |= vars(base).get("__annotations__", {})
    chosen = {name: field for name, field in cls.model_fields.items() if name not in ("model", "light")}
    return Signature([
        Parameter(name, Parameter.KEYWORD_ONLY, default=Parameter.empty if field.is_required() else field.default,
                  annotation=_Written(written[name]))
        for name, field in sorted(chosen.items(), key=lambda item: not item[1].is_required())
    ])  # fmt: skip


def option_error(error: ValidationError, source: str, fields: Iterable[str] = ()) -> OptionError:
    """The first fault of a validation, in this project's words. Args: fields: the names that are known."""
    fault = first_fault(error)
    cause = fault.get("ctx", {}).get("error")
    if isinstance(cause, OptionError):
        return cause
    field = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"]).lstrip(".")
    if fault["type"] == "union_tag_not_found":
        context = fault["ctx"]
        return OptionError(context["discriminator"].strip("'"), "a value", "nothing", source)
    if fault["type"] == "union_tag_invalid":
        context = fault["ctx"]
        allowed, tag = _quoted(context["expected_tags"]), context["tag"]
        expected, near = "one of " + ", ".join(allowed), nearest_name(tag, allowed)
        return OptionError(context["discriminator"].strip("'"), expected, tag, source, near)
    if fault["type"] == "missing":
        return OptionError(field, "a value", "nothing", source)
    if fault["type"] == "extra_forbidden":
        return OptionError(field, "one of " + ", ".join(fields), "an unknown key", source, nearest_name(field, fields))
    if not field:
        return OptionError(source, "a table of names and values", repr(fault["input"]), "value")
    near = nearest_name(fault["input"], _quoted(fault["ctx"]["expected"])) if fault["type"] == "literal_error" else None
    return OptionError(field, expectation(fault), fault["input"], source, near)


def first_fault(error: ValidationError) -> ErrorDetails:
    """The fault to tell: an unknown name before a missing one, which it may be."""
    faults = error.errors()
    unknown = (fault for fault in faults if fault["type"] == "extra_forbidden")
    return next(unknown, faults[0]) if faults[0]["type"] == "missing" else faults[0]


def _quoted(text: str) -> list[str]:
    return re.findall("'([^']*)'", text)


_EXPECTATIONS = {
    "bool_type": "true or false",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "list_type": "a list",
    "string_type": "a text",
    "tuple_type": "a list of numbers",
}


def expectation(fault: ErrorDetails) -> str:
    """What pydantic would have accepted, in a few words."""
    message = fault["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return _EXPECTATIONS.get(fault["type"], message[:1].lower() + message[1:])
