"""Usage errors in one line: what was expected, what was given, the nearest name, and where help is."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from obscurance.raytrace.errors import (
    ConflictError,
    InputError,
    ObscuranceError,
    OptionError,
    nearest_name,
    printable,
    shortened,
)

_OPTIONS = ("options", "render")  # what errors about options of the command name as their source


def fault_in_words(fault: Any, app: Any, arguments: Sequence[str]) -> str:
    """The words of an exception, with options by their names. Args: app: all commands. arguments: as typed."""
    command = app.commands.get(arguments[0]) if arguments else None
    if isinstance(fault, InputError):
        return _option_in_words(fault, command)
    return str(fault) if isinstance(fault, ObscuranceError) else _mistake_in_words(fault, app, command)


def _mistake_in_words(mistake: click.UsageError, app: click.Group, command: click.Command | None) -> str:
    """A mistake that the parser found."""
    subject = str(command.name) if command else ""
    near = None
    if isinstance(mistake, click.NoSuchOption):
        names = [name for item in (command or app).params for name in (*item.opts, *item.secondary_opts)]
        expected = "one of its options"
        got = mistake.option_name
        near = nearest_name(got, [*names, "--help"])
    elif isinstance(mistake, click.BadOptionUsage):
        subject = f"{subject} {mistake.option_name}".lstrip()
        takes = "requires" in mistake.message
        expected, got = ("a value", "nothing") if takes else ("the option alone", "a value")
    elif isinstance(mistake, click.MissingParameter):
        expected = _name_in_words(mistake.param)
        got = "nothing"
    elif isinstance(mistake, click.exceptions.NoSuchCommand):
        subject = "command"
        expected = "one of " + ", ".join(app.commands)
        got = mistake.command_name
        near = nearest_name(got, app.commands)
    else:
        expected = "no more arguments"
        got = mistake.message.partition("(")[2].removesuffix(")")
    return _line(subject, expected, got, near, command)


def _option_in_words(mistake: InputError, command: Any) -> str:
    """A mistake that the command itself found: an option by its name, where there is one of that name."""
    if (mistake.field, mistake.got) == ("file", "none"):
        return str(mistake) + _file_meant(Path(mistake.source))
    if command is None or not isinstance(mistake, OptionError) or mistake.source not in _OPTIONS:
        return str(mistake)
    parameters = {item.name: item for item in command.params}
    if isinstance(mistake, ConflictError):

        def in_command(term: Any) -> str:
            """A term of the mistake, an option or a pair of an option and its value, as it is typed in the command."""
            name, *value = (term,) if isinstance(term, str) else term
            item = parameters.get(name)
            if item is None:
                return str(name)
            if not value:
                return _name_as_typed(item) if name == mistake.field else _name_in_words(item)
            flag = item.secondary_opts[0] if value[0] is False else item.opts[0]
            return str(flag if isinstance(value[0], bool) else f"{flag} {value[0]}")

        return printable(f"{command.name}: {mistake.in_words(in_command)}; see obscurance {command.name} --help")
    shown = _name_as_typed(parameters[mistake.field]) if mistake.field in parameters else mistake.field
    return _line(f"{command.name} {shown}", mistake.expected, mistake.got, mistake.nearest, command)


def _line(subject: str, expected: str, got: object, near: str | None, command: Any) -> str:
    """The line that reports a mistake. Args: near: a name that was probably meant. command: Click's."""
    name = f" {command.name}" if command else ""
    got_text = shortened(got) or '""'
    hint = f"did you mean {near}? See" if near else "see"
    text = f"expected {expected}, got {got_text}; {hint} obscurance{name} --help"
    return printable(f"{subject}: {text}" if subject else text)


def _file_meant(missing: Path) -> str:
    """The existing file, or built-in scene, whose name differs from a missing file's by its ending."""
    from ..library import BUILTIN

    if missing.name in BUILTIN:
        return f"; obscurance scenes {missing.name} -o {missing.name}.toml writes that built-in scene"
    try:
        names = [missing.with_name(name) for name in sorted(os.listdir(missing.parent))[:10_000]]
    except OSError:
        return ""
    by_stem = {path.stem: path for path in sorted(names, key=lambda path: path.suffix == missing.suffix)}
    near = nearest_name(missing.stem, by_stem)
    return printable(f"; did you mean {by_stem[near]}?") if near else ""


def _name_in_words(parameter: Any) -> str:
    """A parameter in words: an option by its long name, an argument as the help shows it."""
    is_option = isinstance(parameter, click.Option)
    return str(parameter.opts[0] if is_option else parameter.human_readable_name.removesuffix("..."))


def _name_as_typed(parameter: Any) -> str:
    """A parameter as it was typed; a switch that is on by default by the name that turns it off."""
    off = parameter.default is True and parameter.secondary_opts
    return str(parameter.secondary_opts[0]) if off else _name_in_words(parameter)
