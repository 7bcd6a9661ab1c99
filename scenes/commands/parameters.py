"""Parameters of a command from the rows of its table, and its help: the options that matter, or all by what they do."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import click

from obscurance.ao.declared import Option
from obscurance.raytrace.errors import OptionError

_GONE = {name: "--cluster" for name in ("--tiles", "--part", "--shared")}
"""Options that are no more, and what to do instead."""
_WHOLE = "whole help"
_METAVARS = {int: "N", float: "NUMBER", str: "TEXT", Path: "FILE"}


class Value(click.ParamType[Any, Any]):
    """A value of a row, checked by `Option.parsed`."""

    name = "value"

    def __init__(self, row: Option) -> None:
        self.row = row

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str | None:
        """By its type; an argument's is its name."""
        return None if self.row.is_argument else "|".join(get_args(self.row.element)) or _METAVARS[self.row.element]

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The checked value of a word, as Click asks for it. Raises: as `Option.parsed`."""
        return self.row.parsed(value)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
        """The words that complete an incomplete one in a shell."""
        from click.shell_completion import CompletionItem

        if self.row.element is Path:
            return [CompletionItem(incomplete, type="file")]
        words = self.row.words() if callable(self.row.words) else self.row.words or get_args(self.row.element)
        return [CompletionItem(word) for word in words if word.startswith(incomplete)]


def parameter(row: Option) -> click.Parameter:
    """The row as Click's parameter."""
    more: dict[str, Any] = {"help": row.help, "metavar": row.metavar, "required": row.default is ...}
    if row.default is not ...:
        more["default"] = row.default
    if row.is_list:
        more["callback"] = _listed
    if row.is_argument:
        return click.Argument([row.name], type=Value(row), nargs=-1 if row.is_list else 1, **more)
    if row.name == "options":
        more |= {"is_eager": True, "callback": _take_options, "expose_value": False}
    names = [row.name, *row.flags]
    if row.element is bool:
        return click.Option(names, is_flag=True, hidden=not row.help, **more)
    return click.Option(names, type=Value(row), multiple=row.is_list, **more)


def _listed(_: click.Context, __: click.Parameter, values: Sequence[Any]) -> list[Any] | None:
    """The values of an option that may be repeated, None if there are none."""
    return list(values) or None


def _take_options(context: click.Context, _: click.Parameter, report: Path | None) -> None:
    """Click's callback of `--options`: an earlier bake's options become the defaults of the others."""
    if report is not None:
        from ..bake.report import saved_options

        context.default_map = saved_options(report)


class TableCommand(click.Command):
    """A command whose parameters are the rows of a table.

    Its help after `-h` has the options that matter, those without a section, after `-h all` every option.

    `--colors` alone, before no word of letters only, which no file's name is, stands for `--colors rgb`.
    """

    def __init__(self, rows: Sequence[Option], **settings: Any) -> None:
        super().__init__(**settings)
        self._rows = rows
        self._sections = {row.name: row.section for row in rows}
        self._long = {row.short: row.flags[0] for row in rows}
        options = [row for row in rows if not row.is_argument]
        self._is_switch = {flag: row.element is bool for row in options for flag in row.flags[0].split("/")}

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """The parameters, as Click asks for them; made of the rows when the command is called."""
        self.params = self.params or [*map(parameter, self._rows)]  # of the command that is called
        return super().get_params(ctx)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the words, with short names written out. Raises: OptionError: an option is gone, or stands where the
        value of another is wanted."""
        ctx.meta[_WHOLE] = args[-1:] == ["all"]
        bare = [word == "--colors" and not after.isalpha() for word, after in pairwise([*args, ""])]
        words = [f"{word}=rgb" if is_bare else word for word, is_bare in zip(args, bare, strict=True)]
        if "--" not in words:  # after which a word is a file's name
            words = [self._long.get(word, word) for word in words]  # or Click looks for long names like a short one
            for (option, value), typed in zip(pairwise(words), args[1:], strict=True):
                if value in self._is_switch and not self._is_switch.get(option, True):
                    raise OptionError(option, "a value", typed)
        for word in words:
            name = word.partition("=")[0]
            if name in _GONE:
                raise OptionError(name, _GONE[name], f"{name}, which is no more")
        return super().parse_args(ctx, words)

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The help, with its examples before the options."""
        self.format_usage(ctx, formatter)
        self.format_help_text(ctx, formatter)
        self.format_epilog(ctx, formatter)  # examples
        self.format_arguments(ctx, formatter)
        self.format_options(ctx, formatter)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The options without a section; after `-h all` those with one, too."""
        sections: dict[str, list[tuple[str, str]]] = {"Options": []}
        for item in self.get_params(ctx):
            record = item.get_help_record(ctx)
            if record and isinstance(item, click.Option):
                sections.setdefault(self._sections.get(item.name) or "Options", []).append(record)
        shown = sections if ctx.meta.get(_WHOLE) else ["Options"]
        for title in shown:
            with formatter.section(title):
                formatter.write_dl(sections[title])
        hidden_count = sum(len(records) for title, records in sections.items() if title not in shown)
        if hidden_count:
            formatter.write_paragraph()
            formatter.write_text(f"{hidden_count} more options: {ctx.command_path} -h all")
