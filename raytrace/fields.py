"""Validated, immutable parameter classes, and the types of their fields.

A wrong value raises `OptionError`, which names the class, the field, the accepted range and the value.
"""

from __future__ import annotations

from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

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
        raise ValueError("Input should be a vector other than zero")
    return value


def _vector(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


Real = Annotated[float, Field(allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Slope = Annotated[float, Field(ge=1e-6, le=100, allow_inf_nan=False)]
Index = Annotated[float, Field(ge=1, le=1e6, allow_inf_nan=False)]

Reflectance = Annotated[tuple[Fraction, Fraction, Fraction], BeforeValidator(_triple)]
Radiance = Annotated[tuple[NonNegative, NonNegative, NonNegative], BeforeValidator(_triple)]
Indices = Annotated[tuple[Index, Index, Index], BeforeValidator(_triple)]
Point = Annotated[tuple[Real, Real, Real], BeforeValidator(_vector)]
Direction = Annotated[Point, AfterValidator(_direction)]


class Parameters(BaseModel):
    """Base of materials and lights: frozen, no unknown fields, errors as `OptionError`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __init__(self, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise option_error(error, type(self).__name__) from None

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, strings and lists, ready for a TOML scene; only what differs from the defaults, and the tag."""
        tag = {name: getattr(self, name) for name in ("model", "light") if name in type(self).model_fields}
        return tag | self.model_dump(mode="json", exclude_defaults=True, exclude_none=True)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The inverse of `to_dict`. Raises: OptionError."""
        return cls(**data)


def option_error(error: ValidationError, source: str) -> OptionError:
    """The first fault of a validation, in this project's words."""
    fault = error.errors()[0]
    cause = fault.get("ctx", {}).get("error")
    if isinstance(cause, OptionError):
        return cause
    field = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"]).lstrip(".")
    message = fault["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if fault["type"] == "missing":
        return OptionError(field, "a value", "nothing", source)
    if fault["type"] == "extra_forbidden":
        return OptionError(field, "no such field", fault["input"], source)
    return OptionError(field, message[:1].lower() + message[1:], fault["input"], source)
