"""Validated, immutable parameter classes, and the types of their fields.

A wrong value raises `OptionError`, which names the class, the field, the accepted range and the value.
pydantic, because ranges are declared by its own constraints; on dataclasses, so that positional values,
`dataclasses.replace` and type checkers work; built when first used.
"""

from abc import ABCMeta
from collections.abc import Iterable, Mapping
from dataclasses import fields
from inspect import Parameter, Signature
from math import inf, pi
from numbers import Integral, Real
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, dataclass_transform

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass as validated

from ..errors import OptionError, nearest_name
from .faults import declared, fields_of, first_fault, most_telling


def _listed(value: Any) -> Any:
    """An array as plain lists, one of NumPy's numbers as a plain one."""
    return value.tolist() if hasattr(value, "tolist") else value


def triple(value: Any) -> Any:
    """A single number stands for three equal ones."""
    value = _listed(value)
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def _direction(value: tuple[float, float, float]) -> tuple[float, float, float]:
    """Check that a vector is not zero."""
    if value == (0.0, 0.0, 0.0):
        raise ValueError("a vector other than zero")
    return value


def _side(value: Any) -> Any:
    """Check a value of `two_sided`."""
    if not isinstance(value, bool) and value != "viewer":
        raise ValueError('true, false or "viewer"')
    return value


def _number(value: Any) -> Any:
    """Check that a value is a real number, before pydantic makes one of a text."""
    if not isinstance(value, Real):
        raise ValueError("a number")
    return value


def _whole(value: Any) -> Any:
    """A whole number of any type, such as NumPy's, as an int; other values as they are."""
    return int(value) if isinstance(value, Integral) and not isinstance(value, bool) else value


Finite = Annotated[float, Field(allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0, lt=inf)]
NonNegative = Annotated[float, Field(ge=0, lt=inf)]
Length = Annotated[float, Field(ge=1e-100, le=1e100)]  # products of a few neither vanish nor overflow
Slope = Annotated[float, Field(ge=1e-6, le=100)]
Index = Annotated[float, Field(ge=1, le=1e6)]
ConductorIndex = Annotated[float, Field(ge=0.01, le=1e6)]
Extinction = Annotated[float, Field(ge=0, le=1e6)]
Exponent = Annotated[float, Field(gt=0, le=1e6)]
Smoothness = Annotated[float, Field(ge=0, lt=1)]
Spacing = Annotated[float, Field(ge=1e-3, le=1e6)]
Angle = Annotated[float, Field(ge=0, le=pi / 2, description="radians in [0, π/2]")]
HalfAngle = Annotated[float, Field(gt=0, le=90, description="degrees in (0, 90]")]
Diameter = Annotated[float, Field(ge=0, le=90, description="degrees in [0, 90]")]
Nanometres = Annotated[float, Field(ge=1e-3, le=1e7)]
Number = Annotated[float, BeforeValidator(_number)]  # no text that reads as one
Whole = Annotated[int, Field(strict=True), BeforeValidator(_whole)]
Switch = Annotated[bool, Field(strict=True), BeforeValidator(_listed)]
Seed = Annotated[Whole, Field(ge=0, le=2**64 - 1)]

N = TypeVar("N", bound=float)
if TYPE_CHECKING:  # three are kept, one number may be given
    Triple = tuple[N, N, N] | Any
else:
    Triple = Annotated[tuple[N, N, N], BeforeValidator(triple)]
Reflectance = Triple[Fraction]
Radiance = Triple[NonNegative]
Indices = Triple[Index]
ConductorIndices = Triple[ConductorIndex]
Extinctions = Triple[Extinction]
Wavelengths = Triple[Nanometres]
Lengths = Triple[Length]
Point = Annotated[tuple[Finite, Finite, Finite], BeforeValidator(_listed)]
Direction = Annotated[Point, AfterValidator(_direction)]
Sides = Annotated[bool | Literal["viewer"], BeforeValidator(_side)]

_TAGS = ("model", "light")
P = TypeVar("P", bound="Parameters")


class _Written(str):
    """An annotation that `help` shows as the source has it, without quotes."""

    def __repr__(self) -> str:
        return str(self)


class _Refusing(ABCMeta):
    """Metaclass of classes whose constructors raise `OptionError`, and whose signatures can be read."""

    source_name: str

    def __call__(cls, *unnamed: Any, **named: Any) -> Any:
        by_place = [field.name for field in fields(cls) if not field.kw_only]  # type: ignore[arg-type]
        if len(unnamed) > len(by_place) or named.keys() & set(by_place[: len(unnamed)]):
            example = f"{cls.__name__}({next(iter(cls.__signature__.parameters))}=…)"
            got = ", ".join(map(repr, unnamed))
            raise OptionError("values", f"each by its name, as in {example}", got, cls.source_name)
        values = dict(zip(by_place, unnamed, strict=False)) | named
        try:
            return super().__call__(**values)
        except ValidationError as error:
            raise _option_error(error, cls, values) from None

    @property
    def __signature__(cls) -> Signature:
        """The parameters, required ones first, with the names of their types in this module, for `help`."""
        written: dict[str, str] = {}
        for base in reversed(cls.__mro__):
            written |= vars(base).get("__annotations__", {})
        chosen = {name: field for name, field in fields_of(cls).items() if name not in _TAGS}
        kinds = {True: Parameter.KEYWORD_ONLY, False: Parameter.POSITIONAL_OR_KEYWORD}
        return Signature([
            Parameter(name, kinds[bool(field.kw_only)],
                      default=Parameter.empty if field.is_required() else field.default,
                      annotation=_Written(written[name]))
            for name, field in sorted(chosen.items(), key=lambda item: not item[1].is_required())
        ])  # fmt: skip

    @__signature__.setter
    def __signature__(cls, _: object) -> None:
        """Keep the one above: pydantic sets its own as it makes a class."""


def _option_error(error: ValidationError, kind: _Refusing, values: dict[str, Any]) -> OptionError:
    """Pydantic's error as an `OptionError`: the most telling fault, named by its field.

    A field with a description is reported with that and its whole value.
    """
    fault = most_telling(error)
    cause = fault.get("ctx", {}).get("error")
    if isinstance(cause, OptionError):
        return cause
    name = str(fault["loc"][0])
    description = declared(kind, [name]).description
    if description and name in values:
        got = repr(values[name]) if isinstance(values[name], str) else values[name]
        return OptionError(name, str(cause or description), got, kind.source_name)
    reason = first_fault(error, kind)
    return OptionError(reason.path, reason.expected, reason.got, kind.source_name, reason.nearest)


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Parameters(metaclass=_Refusing):
    """Base of materials, lights, shapes, cameras and options: frozen, no unknown fields, errors as `OptionError`.

    Arguments of a subclass: `kw_only`, False if values may be given by their place too; `source`: its name in messages.
    """

    def __init_subclass__(cls, kw_only: bool = True, source: str | None = None) -> None:
        super().__init_subclass__()
        cls.source_name = source or cls.__name__
        validated(cls, frozen=True, kw_only=kw_only, config=ConfigDict(extra="forbid", defer_build=True))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, strings and lists, ready for a TOML scene: the tag, and what differs from the defaults."""
        values_and_defaults = {field.name: (getattr(self, field.name), field.default) for field in fields(self)}  # type: ignore[arg-type]
        changed = {name: values_and_defaults[name][0] for name in _TAGS if name in values_and_defaults}
        changed |= {
            name: value
            for name, (value, default) in values_and_defaults.items()
            if value is not None and value != default
        }
        return {name: list(value) if isinstance(value, tuple) else value for name, value in changed.items()}


def made_of(data: Any, kinds: Iterable[type[P]], tag: str, source: str) -> P:
    """One of `kinds` from plain values: that whose field `tag` has by default what these have. Raises: OptionError."""
    if not isinstance(data, Mapping):
        raise OptionError(source, "a table of names and values", repr(data), "value")
    if tag not in data:
        raise OptionError(tag, "a value", "nothing", source)
    named = {getattr(kind, tag): kind for kind in kinds}
    if not isinstance(data[tag], str) or data[tag] not in named:
        raise OptionError(tag, "one of " + ", ".join(named), data[tag], source, nearest_name(data[tag], named))
    return named[data[tag]](**{str(name): value for name, value in data.items()})
