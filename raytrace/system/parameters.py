"""Immutable parameter classes that check themselves, and the types of their fields.

A wrong value raises `OptionError`, which names the class, the field, the accepted range and the value.
"""

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, fields
from inspect import Parameter, Signature
from math import inf, pi
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeVar, dataclass_transform

from ..errors import OptionError, nearest_name
from .records import Before, Fault, Within, plain, read_fields


def triple(value: Any) -> Any:
    """A single number stands for three equal ones."""
    value = plain(value)
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def _direction(value: tuple[float, float, float]) -> tuple[float, float, float]:
    """Check that a vector is not zero."""
    if value == (0.0, 0.0, 0.0):
        raise ValueError("a vector other than zero")
    return value


def _side(value: Any) -> Any:
    """Check a value of `two_sided`."""
    value = plain(value)
    if not isinstance(value, bool) and value != "viewer":
        raise ValueError('true, false or "viewer"')
    return value


Fraction = Annotated[float, Within(0, 1)]
Positive = Annotated[float, Within(0, inf, "()")]
NonNegative = Annotated[float, Within(0, inf, "[)")]
Length = Annotated[float, Within(1e-100, 1e100)]  # products of a few neither vanish nor overflow
Slope = Annotated[float, Within(1e-6, 100)]
Index = Annotated[float, Within(1, 1e6)]
ConductorIndex = Annotated[float, Within(0.01, 1e6)]
Extinction = Annotated[float, Within(0, 1e6)]
Exponent = Annotated[float, Within(0, 1e6, "(]")]
Smoothness = Annotated[float, Within(0, 1, "[)")]
Spacing = Annotated[float, Within(1e-3, 1e6)]
Angle = Annotated[float, Within(0, pi / 2), "radians in [0, π/2]"]
HalfAngle = Annotated[float, Within(0, 90, "(]"), "degrees in (0, 90]"]
Diameter = Annotated[float, Within(0, 90), "degrees in [0, 90]"]
Nanometres = Annotated[float, Within(1e-3, 1e7)]
Seed = Annotated[int, Within(0, 2**64 - 1)]

N = TypeVar("N", bound=float)
if TYPE_CHECKING:  # three are kept, one number may be given
    Triple = tuple[N, N, N] | Any
else:
    Triple = Annotated[tuple[N, N, N], Before(triple)]
Reflectance = Triple[Fraction]
Radiance = Triple[NonNegative]
Indices = Triple[Index]
ConductorIndices = Triple[ConductorIndex]
Extinctions = Triple[Extinction]
Wavelengths = Triple[Nanometres]
Lengths = Triple[Length]
Point = tuple[float, float, float]
Direction = Annotated[Point, _direction]
Sides = Annotated[bool | Literal["viewer"], _side]

_TAGS = ("model", "light")
P = TypeVar("P", bound="Parameters")


class _Written(str):
    """An annotation that `help` shows as the source has it, without quotes."""

    def __repr__(self) -> str:
        return str(self)


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Parameters:
    """Base of materials, lights, shapes, cameras and settings: frozen, no unknown fields, errors as `OptionError`.

    Arguments of a subclass: `kw_only`, False if values may be given by their place too; `source`: its name in messages.
    """

    source_name: ClassVar[str]
    __signature__: ClassVar[Signature]

    def __init_subclass__(cls, kw_only: bool = True, source: str | None = None) -> None:
        super().__init_subclass__()
        cls.source_name = source or cls.__name__
        dataclass(frozen=True, kw_only=kw_only, init=False)(cls)
        kinds = {True: Parameter.KEYWORD_ONLY, False: Parameter.POSITIONAL_OR_KEYWORD}
        parameters = [
            Parameter(field.name, kinds[bool(field.kw_only)],
                      default=Parameter.empty if field.default is MISSING else field.default,
                      annotation=_Written(field.type))
            for field in _fields(cls)
            if field.name not in _TAGS
        ]  # fmt: skip
        cls.__signature__ = Signature(sorted(parameters, key=lambda each: each.default is not Parameter.empty))

    def __init__(self, *unnamed: Any, **named: Any) -> None:
        by_place = [field.name for field in _fields(self) if not field.kw_only]
        if len(unnamed) > len(by_place) or named.keys() & set(by_place[: len(unnamed)]):
            example = f"{type(self).__name__}({next(iter(self.__signature__.parameters))}=…)"
            got = ", ".join(map(repr, unnamed))
            raise OptionError("values", f"each by its name, as in {example}", got, self.source_name)
        values = dict(zip(by_place, unnamed, strict=False)) | named
        try:
            given = read_fields(type(self), values)
        except Fault as fault:
            raise OptionError(fault.place, fault.expected, fault.got, self.source_name, fault.nearest) from None
        vars(self).update({field.name: field.default for field in _fields(self)} | given)
        self.check()

    def check(self) -> None:
        """Check the fields together. Raises: OptionError."""

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, strings and lists, ready for a TOML scene: the tag, and what differs from the defaults."""
        values_and_defaults = {field.name: (getattr(self, field.name), field.default) for field in _fields(self)}
        changed = {name: values_and_defaults[name][0] for name in _TAGS if name in values_and_defaults}
        changed |= {
            name: value
            for name, (value, default) in values_and_defaults.items()
            if value is not None and value != default
        }
        return {name: list(value) if isinstance(value, tuple) else value for name, value in changed.items()}


def made_of(data: Any, kinds: Iterable[type[P]], tag: str, source: str) -> P:
    """An object of that of `kinds` whose default of the field `tag` plain values name. Raises: OptionError."""
    if not isinstance(data, Mapping):
        raise OptionError(source, "a table of names and values", repr(data), "value")
    if tag not in data:
        raise OptionError(tag, "a value", "nothing", source)
    named = {getattr(kind, tag): kind for kind in kinds}
    if not isinstance(data[tag], str) or data[tag] not in named:
        raise OptionError(tag, "one of " + ", ".join(named), data[tag], source, nearest_name(data[tag], named))
    return named[data[tag]](**{str(name): value for name, value in data.items()})


def _fields(kind: Any) -> tuple[Field[Any], ...]:
    """The fields of a subclass of `Parameters`, or of an object of one."""
    return fields(kind)
