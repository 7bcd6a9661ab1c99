"""Parameters of a command from the rows of its table, and its help in sections."""

from collections.abc import Callable, Iterable
from importlib import import_module
from inspect import Parameter, Signature
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from typer.core import TyperCommand

from ao.declared import Option
from raytrace.errors import OptionError

from ..bake.options import BAKE, ROWS

_OLD = {f"--{no}{row.old_name}": f"--{no}{row.name}" for row in BAKE if row.old_name for no in ("", "no-")}
_GONE = {"--tiles": "--part K/N, each on a machine of its own, and obscurance merge"}
"""Options that are no more, and what to do instead."""
EXAMPLES = """\b
Examples, with the mesh that obscurance demo writes:
  obscurance bake demo/temple.ply -o temple.glb
  obscurance bake demo/temple.ply -o temple.html --falloff binary --tolerance 0.02
  obscurance bake 'demo/*.ply' --output-dir baked --format glb
  obscurance bake demo/temple.ply -o temple.png --uv unwrap --mesh-output temple.glb
"""
F = TypeVar("F", bound=Callable[..., object])


def parameters(rows: Iterable[Option]) -> Callable[[F], F]:
    """Give a command that takes any values by their names a parameter for each row."""

    def with_parameters(command: F) -> F:
        given = []
        for row in rows:
            default = Parameter.empty if row.default is ... else row.default
            form = {"annotation": Annotated[row.kind, parameter(row)], "default": default}
            given.append(Parameter(row.name, Parameter.KEYWORD_ONLY, **form))
        command.__signature__ = Signature(given)  # type: ignore[attr-defined]
        return command

    return with_parameters


def parameter(row: Option) -> Any:
    """The row as Typer's parameter: an argument if it has no default."""
    if row.default is ...:
        return typer.Argument(metavar=row.metavar, help=row.help)
    more: dict[str, Any] = {}
    if row.words:
        more["autocompletion"] = lambda incomplete: [word for word in row.words if word.startswith(incomplete)]
    if row.name == "options":
        more |= {"parser": Path, "is_eager": True, "callback": _take_options, "expose_value": False}
    return typer.Option(*row.flags, metavar=row.metavar, help=row.help, **more)


def name_of(table: str, help: str) -> Any:
    """The argument NAME, which a shell completes by a table given as module.TABLE and imported only then."""
    module, _, name = table.rpartition(".")

    def names(begun: str) -> list[str]:
        return [each for each in getattr(import_module(module), name) if each.startswith(begun)]

    return typer.Argument(metavar="NAME", help=help, autocompletion=names)


class TableCommand(TyperCommand):
    """`bake` and `merge`: their help lists options by what they are for; options by earlier names are understood.

    `--colors` alone, before no word of letters only, which no file's name is, stands for `--colors rgb`.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        bare = [each == "--colors" and not after.isalpha() for each, after in pairwise([*args, ""])]
        pairs = [(f"{each}=rgb" if is_bare else each).partition("=") for each, is_bare in zip(args, bare, strict=True)]
        for name, _, _ in pairs:
            if name in _GONE:
                raise OptionError(name.removeprefix("--"), _GONE[name], f"{name}, which is no more")
        return super().parse_args(ctx, [_OLD.get(name, name) + sign + value for name, sign, value in pairs])

    def format_options(self, ctx: Any, formatter: Any) -> None:
        rows: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for item in self.get_params(ctx):
            if (record := item.get_help_record(ctx)) is not None:
                general = "Arguments" if item.param_type_name == "argument" else "Options"
                row = ROWS.get(str(item.name))
                rows.setdefault((row and row.section) or general, []).append(record)
        for title, found in rows.items():
            with formatter.section(title):
                formatter.write_dl(found)


def _take_options(context: typer.Context, report: Path | None) -> None:
    """Let options that are not given have the values that they had in an earlier bake."""
    if report is not None:
        from ..bake.report import saved_options

        context.default_map = saved_options(report)
