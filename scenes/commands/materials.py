"""`obscurance materials`: the presets, listed or written as TOML."""

from typing import Any

from obscurance.raytrace import PRESETS
from obscurance.raytrace.errors import OptionError, nearest_name


def presets() -> list[tuple[str, str]]:
    """The name of each preset, and its values in one line."""
    return [
        (name, ", ".join(f"{key} = {_value(value)}" for key, value in values.items()))
        for name, values in PRESETS.items()
    ]


def preset_toml(name: str) -> str:
    """A preset as an entry of a scene's `[[materials]]`. Raises: OptionError: there is none of this name."""
    if name not in PRESETS:
        raise OptionError("name", "one of " + ", ".join(sorted(PRESETS)), name, nearest=nearest_name(name, PRESETS))
    lines = [f"{key} = {_value(value, None)}" for key, value in PRESETS[name].items()]
    return "\n".join(["[[materials]]", f'name = "my_{name}"', *lines, ""])


def _value(value: Any, digits: int | None = 5) -> str:
    """A value as TOML has it, one number for three equal ones. Args: digits: None: the shortest exact form."""
    if isinstance(value, list | tuple):
        parts = [_value(part, digits) for part in value]
        return parts[0] if len(set(parts)) == 1 else f"[{', '.join(parts)}]"
    if isinstance(value, float) and digits:
        return f"{value:.{digits}g}"
    return f'"{value}"' if isinstance(value, str) else str(value)
