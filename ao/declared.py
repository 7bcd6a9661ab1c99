"""Declarations of options: fields of a dataclass, annotated with rows of the command's table.

From one follow the check of a value, the parameter of `ao.bake` with its description, and the option of the command.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from functools import cache, wraps
from inspect import Parameter, Signature, cleandoc
from pathlib import Path
from textwrap import fill
from types import NoneType, new_class
from typing import Annotated, Any, ForwardRef, Literal, ParamSpec, TypeVar, get_args, get_origin

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
Role = Literal["input", "output", "result", "run"]
EVERY_BAKE = "vertices texture part batch"
IMAGE = "texture part batch"
SAME: Any = object()  # as the field has it


@dataclass(frozen=True, eq=False)
class Option:
    """A row of the command's table, or what annotates a field."""

    name: str = ""  # in Python and in reports
    kind: Any = SAME  # its type, or its choices
    default: Any = SAME  # `...` of an argument that is needed
    help: str = ""  # in one line
    bake_kinds: str = EVERY_BAKE  # that take it: vertices, texture, part, merge, batch; none: Python alone
    role: Role = "result"  # a file that is read, what is written, what is computed, or how that is run
    needs: Mapping[str, Any] = field(
        default_factory=dict
    )  # other options, and their value, `...` for any but the default
    excludes: tuple[str, ...] = ()  # other options
    metavar: str | None = None
    short: str | None = None
    section: str = ""  # of the help
    old_name: str | None = None
    words: tuple[str, ...] = ()  # for completion
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
    def reusable(self) -> bool:
        """Whether `--options` takes it over."""
        return self.is_setting and self.role != "run" and not (self.role == "output" and self.kind == Path | None)


def rows(record: Any) -> dict[str, Option]:
    """The options that a record declares."""
    options_of = {}
    for declared in fields(record):
        kind, row = _declaration(declared)
        same = {"kind": kind, "default": declared.default}
        options_of[declared.name] = replace(
            row, name=declared.name, **{key: same[key] for key in same if getattr(row, key) is SAME}
        )
    return options_of


def _declaration(field: Field[Any]) -> tuple[Any, Option]:
    """The type of a field in Python, and its row."""
    kind: Any = field.type
    return kind.__origin__, kind.__metadata__[0]


def check_values(record: Any) -> None:
    """Make the numbers, choices and switches of a record plain. Raises: OptionError: one is out of range."""
    checks = _checks(record.__class__)
    for name, value in vars(
        checks(**{declared.name: getattr(record, declared.name) for declared in fields(checks)})
    ).items():
        object.__setattr__(record, name, value)


@cache
def _checks(record: Any) -> Any:
    """A class that takes values of a record by their names, and checks them by their types."""
    from raytrace.system.parameters import Parameters

    kinds = {field.name: _checked(*_declaration(field)) for field in fields(record)}
    kinds = {name: kind for name, kind in kinds.items() if kind is not Any}
    return new_class("Values", (Parameters,), {"source": "options"}, lambda names: names.update(__annotations__=kinds))


def _checked(kind: Any, row: Option) -> Any:
    """The type of a field as pydantic checks it; Any of meshes, falloffs and arrays, which are checked where used."""
    from pydantic import Field

    from raytrace.system.parameters import Switch, Whole

    annotation: Any = Any
    plain = get_args(kind)[0] if NoneType in get_args(kind) else kind
    if get_origin(plain) is Literal:
        *names, last = get_args(plain)
        annotation = Annotated[plain, Field(description=f"{', '.join(names)} or {last}")]
    elif plain is bool:
        annotation = Switch
    elif row.bounds:
        least, most = row.bounds
        annotation = Annotated[Whole, Field(ge=least, le=most)]
        if plain is float:
            text = f"a number from {least:g} to {most:g}".replace("e-0", "e-")
            annotation = Annotated[float, Field(strict=True, ge=least, le=most, description=text)]
    return annotation | None if plain is not kind and annotation is not Any else annotation


def with_option_parameters(record: Callable[P, T]) -> Callable[[Callable[[Any, T], R]], Callable[P, R]]:
    """Let a function of a mesh and a record take the record's fields, some by earlier names too, and describe them."""
    declared: list[Field[Any]] = sorted(fields(record), key=lambda field: bool(field.kw_only))  # type: ignore[arg-type]
    new_names = {row.old_name: name for name, row in rows(record).items() if row.old_name}

    def with_fields(function: Callable[[Any, T], R]) -> Callable[P, R]:
        @wraps(function)
        def called(*unnamed: P.args, **named: P.kwargs) -> R:
            values: Any = {new_names.get(name, name): value for name, value in named.items()}
            try:
                signature.bind(*unnamed, **values)
            except TypeError as fault:
                raise TypeError(f"{function.__name__}() {fault}") from None
            given: Any = record(*unnamed, **values)
            return function(given.mesh, given)

        before, raises, after = cleandoc(function.__doc__ or "").partition("\n\nRaises:")
        called.__doc__ = "\n".join([before, "", "Args:", *map(_described, declared)]) + raises + after
        signature = Signature([*map(_parameter, declared)], return_annotation=function.__annotations__["return"])
        vars(called).update(__signature__=signature, record=record)
        return called

    return with_fields


def call_checked(function: Callable[..., R], options: object, mesh: object, **inputs: Any) -> R:
    """Call a function `with_option_parameters` with options that have been checked, and are not checked again.

    Args: options: of a record that the function's has as a base, or shares one with. inputs: what depends on files, in
        place of what the options have.
    """
    known = vars(function)
    arguments = object.__new__(known["record"])
    values = {field.name: field.default for field in fields(arguments)} | vars(options) | {"mesh": mesh} | inputs
    vars(arguments).update(values)
    called: Callable[[object, object], R] = known["__wrapped__"]
    return called(mesh, arguments)


def _parameter(field: Field[Any]) -> Parameter:
    kind = _declaration(field)[0]
    default = Parameter.empty if field.default is MISSING else field.default
    place = Parameter.KEYWORD_ONLY if field.kw_only else Parameter.POSITIONAL_OR_KEYWORD
    written = kind.__forward_arg__ if isinstance(kind, ForwardRef) else kind
    return Parameter(field.name, place, default=default, annotation=written)


def _described(field: Field[Any]) -> str:
    """A field under "Args:", its help in the names of Python."""
    row = _declaration(field)[1]
    text = re.sub("--([a-z-]+)", lambda flag: f"`{flag[1].replace('-', '_')}`", row.help)
    line = f"{field.name}: {text} {row.python_help}".strip()
    return fill(line, 116, initial_indent=" " * 4, subsequent_indent=" " * 8, break_on_hyphens=False)
