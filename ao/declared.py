"""Declarations of options: fields of a dataclass, annotated with rows of the command's table.

From one follow the check of a value, the parameter of `ao.bake` with its description, and the option of the command.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, fields
from functools import wraps
from inspect import Parameter, Signature, cleandoc
from pathlib import Path
from textwrap import fill
from types import NoneType
from typing import Any, ForwardRef, Literal, NamedTuple, ParamSpec, TypeVar, get_args, get_origin

from raytrace.errors import OptionError, nearest_name

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
Role = Literal["input", "output", "result", "run"]
EVERY_BAKE = "vertices texture batch"
IMAGE = "texture batch"
SAME: Any = object()  # as the field has it
_EXPECTED = {bool: "true or false", int: "a whole number", float: "a number", str: "a text", Path: "a file"}


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
    python_help: str = ""  # what there is to say of it in Python beside `help`

    @property
    def flags(self) -> list[str]:
        """Its names in the command."""
        flag = f"--{self.name.replace('_', '-')}"
        switch = self.kind in (bool, bool | None)
        off = f"/--no-{flag[2:]}" if switch and self.default is not False else ""
        return [flag + off, *([self.short] if self.short else [])]

    @property
    def is_list(self) -> bool:
        """Whether it takes several values."""
        return list in (get_origin(self.kind), *map(get_origin, get_args(self.kind)))

    @property
    def element(self) -> Any:
        """The type of one value that is not None."""
        kind = _without_none(self.kind)
        return get_args(kind)[0] if self.is_list else kind

    def parsed(self, value: object) -> Any:
        """One value of it, from a word of the command line or from JSON. Raises: OptionError: of another type."""
        kind = self.element
        names = get_args(kind)
        if names:
            return _one_of(names, self.name, value)
        try:
            types = str if kind is str else str | int | float
            if not isinstance(value, types) or isinstance(value, bool) is not (kind is bool):
                raise TypeError
            return value if kind is bool else kind(str(value))
        except (TypeError, ValueError):
            raise OptionError(self.name, _EXPECTED[kind], value) from None

    @property
    def reusable(self) -> bool:
        """Whether `--options` takes it over."""
        return self.is_setting and self.role != "run" and not (self.role == "output" and self.kind == Path | None)


def options_of(record: Any) -> dict[str, Option]:
    """The fields of a record as options, in their order."""
    options = {}
    for field in fields(record):
        kind, option = _declaration(field)
        same = {"kind": kind, "default": field.default}
        options[field.name] = option._replace(
            name=field.name, **{key: same[key] for key in same if getattr(option, key) is SAME}
        )
    return options


def _declaration(field: Field[Any]) -> tuple[Any, Option]:
    """The type of a field in Python, and its `Option`."""
    kind: Any = field.type
    return kind.__origin__, kind.__metadata__[0]


def check_values(record: Any) -> None:
    """Make the numbers, choices and switches of a record plain. Raises: OptionError: one is out of range."""
    for field in fields(record):
        kind, option = _declaration(field)
        value = getattr(record, field.name)
        if value is not None or NoneType not in get_args(kind):
            object.__setattr__(record, field.name, _checked(field.name, _without_none(kind), option.bounds, value))


def _checked(name: str, kind: Any, bounds: tuple[float, float] | None, value: Any) -> Any:
    """A value as a plain number, text or switch; meshes, falloffs and arrays are checked where they are used.

    Raises: OptionError.
    """
    plain = value.item() if hasattr(value, "item") and not getattr(value, "shape", ()) else value
    if get_origin(kind) is Literal:
        return _one_of(get_args(kind), name, plain)
    if kind is bool and not isinstance(plain, bool):
        raise OptionError(name, _EXPECTED[bool], value)
    if bounds is None:
        return plain if kind is bool else value
    least, most = bounds
    if not isinstance(plain, kind | int) or isinstance(plain, bool) or not least <= plain <= most:
        number = f"a whole number from {least} to {most}" if kind is int else f"a number from {least:g} to {most:g}"
        raise OptionError(name, number.replace("e-0", "e-"), value)
    return kind(plain)


def _one_of(names: tuple[str, ...], option: str, value: object) -> object:
    """The value, if it is one of `names`. Raises: OptionError."""
    if value in names:
        return value
    raise OptionError(option, "one of " + ", ".join(names), value, nearest=nearest_name(value, names))


def _without_none(kind: Any) -> Any:
    """The type without `None`: T of `T | None`."""
    return get_args(kind)[0] if NoneType in get_args(kind) else kind


def with_option_parameters(record: Callable[P, T]) -> Callable[[Callable[[Any, T], R]], Callable[P, R]]:
    """Let a function of a mesh and a record take the record's fields, and describe them."""
    declared: list[Field[Any]] = sorted(fields(record), key=lambda field: bool(field.kw_only))  # type: ignore[arg-type]

    def with_fields(function: Callable[[Any, T], R]) -> Callable[P, R]:
        """The function with the record's fields as keyword parameters, in its signature and in its docstring."""

        @wraps(function)
        def called(*unnamed: P.args, **named: P.kwargs) -> R:
            """Make the record of the arguments and call the function. Raises: TypeError in the function's name."""
            try:
                signature.bind(*unnamed, **named)
            except TypeError as fault:
                raise TypeError(f"{function.__name__}() {fault}") from None
            arguments: Any = record(*unnamed, **named)
            return function(arguments.mesh, arguments)

        before, raises, after = cleandoc(function.__doc__ or "").partition("\n\nRaises:")
        called.__doc__ = "\n".join([before, "", "Args:", *map(_described, declared)]) + raises + after
        signature = Signature([*map(_parameter, declared)], return_annotation=function.__annotations__["return"])
        vars(called).update(__signature__=signature, record=record)
        return called

    return with_fields


def call_checked(function: Callable[..., R], options: object, mesh: object, **inputs: Any) -> R:
    """Call a function that has `with_option_parameters`, with options that are checked already.

    Args:
        options: of a record that is a base of the function's, or has one in common with it.
        inputs: what depends on files, in place of what the options have.
    """
    attributes = vars(function)
    arguments = object.__new__(attributes["record"])
    values = {field.name: field.default for field in fields(arguments)} | vars(options) | {"mesh": mesh} | inputs
    vars(arguments).update(values)
    called: Callable[[object, object], R] = attributes["__wrapped__"]
    return called(mesh, arguments)


def _parameter(field: Field[Any]) -> Parameter:
    """A field as a parameter of a signature; its annotation is the type that the source has."""
    kind = _declaration(field)[0]
    default = Parameter.empty if field.default is MISSING else field.default
    kind_of_parameter = Parameter.KEYWORD_ONLY if field.kw_only else Parameter.POSITIONAL_OR_KEYWORD
    written = kind.__forward_arg__ if isinstance(kind, ForwardRef) else kind
    return Parameter(field.name, kind_of_parameter, default=default, annotation=written)


def _described(field: Field[Any]) -> str:
    """A line under "Args:" for a field: its help, in the names of Python."""
    row = _declaration(field)[1]
    text = re.sub("--([a-z-]+)", lambda flag: f"`{flag[1].replace('-', '_')}`", row.help)
    line = f"{field.name}: {text} {row.python_help}".strip()
    return fill(line, 116, initial_indent=" " * 4, subsequent_indent=" " * 8, break_on_hyphens=False)
