"""Validated, immutable parameter classes, and the types of their fields.

A wrong value raises `OptionError`, which names the class, the field, the accepted range and the value.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from raytrace.errors import OptionError


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


def within(interval: str) -> AfterValidator:
    """Accepts a float in an interval written as mathematicians do, such as "[0, 1)"; never NaN."""
    low, high = (float(bound) for bound in interval[1:-1].split(","))

    def check(value: float) -> float:
        above = value > low or (value == low and interval[0] == "[")
        below = value < high or (value == high and interval[-1] == "]")
        if not (above and below):
            raise ValueError(f"a number in {interval}")
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
Angle = Annotated[float, within("[0, 1.5707963267948966]")]
HalfAngle = Annotated[float, within("(0, 1.5707963267948966]")]

Reflectance = Annotated[tuple[Fraction, Fraction, Fraction], BeforeValidator(_triple)]
Radiance = Annotated[tuple[NonNegative, NonNegative, NonNegative], BeforeValidator(_triple)]
Indices = Annotated[tuple[Index, Index, Index], BeforeValidator(_triple)]
Point = Annotated[tuple[Real, Real, Real], BeforeValidator(_vector)]
Direction = Annotated[Point, AfterValidator(_direction)]
Sides = Annotated[bool | Literal["viewer"], BeforeValidator(_side)]


class Parameters(BaseModel):
    """Base of materials and lights: frozen, no unknown fields, errors as `OptionError`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __init__(self, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise option_error(error, type(self).__name__) from None

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, strings and lists, ready for a TOML scene: the tag, and what differs from the defaults."""
        tag = {name: getattr(self, name) for name in ("model", "light") if name in type(self).model_fields}
        return tag | self.model_dump(mode="json", exclude_defaults=True, exclude_none=True)


def option_error(error: ValidationError, source: str) -> OptionError:
    """The first fault of a validation, in this project's words."""
    fault = error.errors()[0]
    cause = fault.get("ctx", {}).get("error")
    if isinstance(cause, OptionError):
        return cause
    field = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"]).lstrip(".")
    if fault["type"] == "union_tag_not_found":
        return OptionError(fault["ctx"]["discriminator"].strip("'"), "a value", "nothing", source)
    if fault["type"] == "union_tag_invalid":
        context = fault["ctx"]
        return OptionError(
            context["discriminator"].strip("'"), f"one of {context['expected_tags']}", context["tag"], source
        )
    if fault["type"] == "missing":
        return OptionError(field, "a value", "nothing", source)
    if fault["type"] == "extra_forbidden":
        return OptionError(field, "no such field", fault["input"], source)
    return OptionError(field, expectation(fault), fault["input"], source)


_EXPECTATIONS = {
    "bool_type": "true or false",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "list_type": "a list",
    "string_type": "a text",
    "tuple_type": "a list",
}


def expectation(fault: ErrorDetails) -> str:
    """What pydantic would have accepted, in a few words."""
    message = fault["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return _EXPECTATIONS.get(fault["type"], message[:1].lower() + message[1:])
