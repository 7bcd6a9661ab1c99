"""Declarations of options: fields of a dataclass, annotated with rows of the command's table.

From one follow the check of a value and the option of the command.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import wraps
from inspect import signature
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, NamedTuple, ParamSpec, TypeVar, dataclass_transform, get_args, get_origin

from obscurance.raytrace.errors import OptionError, nearest_name
from obscurance.raytrace.system.records import Fault, Within, reader

Role = Literal["input", "output", "result", "run"]
EVERY_BAKE = "vertices texture batch"
IMAGE = "texture batch"
SAME: Any = object()  # as the field has it
P = ParamSpec("P")
T = TypeVar("T")


class Option(NamedTuple):
    """A row of the command's table, or what annotates a field."""

    name: str = ""  # in Python and in reports
    kind: Any = SAME  # its type, or its choices
    default: Any = SAME  # `...` of what has to be given
    help: str = ""  # in one line
    bake_kinds: str = EVERY_BAKE  # that take it: vertices, texture, batch; none: Python alone
    role: Role = "result"  # a file that is read, what is written, what is computed, or how that is run
    needs: Mapping[str, Any] = {}  # other options, and their value, `...` for any but the default
    excludes: tuple[str, ...] = ()  # other options
    metavar: str | None = None
    short: str | None = None
    section: str = ""  # of the whole help; none of those that matter
    words: Sequence[str] | Callable[[], Iterable[str]] = ()  # for completion
    is_argument: bool = False  # of the command, known by its place
    is_setting: bool = True  # whether `--options` takes it over, if it is no file that is written
    bounds: tuple[float, float] | None = None  # of a number

    @property
    def flags(self) -> list[str]:
        """Its names in the command."""
        flag = f"--{self.name.replace('_', '-')}"
        switch = self.kind in (bool, bool | None)
        off = f"/--no-{flag[2:]}" if switch and self.default is not False else ""
        return [flag + off, *([self.short] if self.short else [])]

    @property
    def is_list(self) -> bool:
        """Whether the option takes several values."""
        return list in (get_origin(self.kind), *map(get_origin, get_args(self.kind)))

    @property
    def element(self) -> Any:
        """The type of one value that is not None."""
        kind = _without_none(self.kind)
        return get_args(kind)[0] if self.is_list else kind

    def parsed(self, value: object) -> Any:
        """One value of it, from a word of the command line or from JSON. Raises: OptionError: of another type."""
        kind = self.element
        made = value
        if isinstance(value, str) and kind in (int, float):
            with suppress(ValueError):
                made = kind(value)
        return Path(_read(str, self.name, made)) if kind is Path else _read(kind, self.name, made)

    @property
    def reusable(self) -> bool:
        """Whether `--options` takes it over."""
        return self.is_setting and self.role != "run" and not (self.role == "output" and self.kind == Path | None)


def known_names(function: Callable[P, T]) -> Callable[P, T]:
    """Wrap a function: an argument of an unknown name is an OptionError with the nearest name."""
    names = signature(function).parameters

    @wraps(function)
    def checked(*unnamed: P.args, **named: P.kwargs) -> T:
        for name in named:
            if name not in names:
                known = [each for each in names if each != "self"]
                expected = "one of " + ", ".join(known)
                raise OptionError(name, expected, "an unknown name", nearest=nearest_name(name, known))
        return function(*unnamed, **named)

    return checked


@dataclass_transform(frozen_default=True)
def options_record(kind: type[T]) -> type[T]:
    """A frozen dataclass of arguments, whose constructor knows its names."""
    made = dataclass(frozen=True, eq=False, repr=False)(kind)
    made.__init__ = known_names(made.__init__)  # type: ignore[method-assign]
    return made


def options_of(record: Any) -> dict[str, Option]:
    """The fields of a record that are options, as rows, in their order."""
    options = {}
    for field in fields(record):
        if get_origin(field.type) is Annotated:
            kind, option = get_args(field.type)
            same = {"kind": kind, "default": field.default}
            options[field.name] = option._replace(
                name=field.name, **{key: same[key] for key in same if getattr(option, key) is SAME}
            )
    return options


def check_values(record: Any) -> None:
    """Make the numbers, choices and switches of a record plain. Raises: OptionError: one is out of range."""
    for field in fields(record):
        if get_origin(field.type) is not Annotated:
            continue
        kind, option = get_args(field.type)
        value = getattr(record, field.name)
        if value is None and NoneType in get_args(kind):
            continue
        plain = _without_none(kind)
        checked = Annotated[plain, Within(*option.bounds)] if option.bounds else plain
        object.__setattr__(record, field.name, _read(checked, field.name, value))


def _read(kind: Any, name: str, value: object) -> Any:
    """A plain value of a type for an option. Raises: OptionError: of another type, or out of range."""
    try:
        return reader(kind)(value)
    except Fault as fault:
        raise OptionError(name, fault.expected, value, nearest=fault.nearest) from None


def _without_none(kind: Any) -> Any:
    """The type without `None`: T of `T | None`."""
    return get_args(kind)[0] if NoneType in get_args(kind) else kind
