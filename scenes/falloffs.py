"""μ by the names that commands and scenes have for it, and tables of μ: CSV, text and `.npy` files of two columns."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from obscurance.ao.falloff import FALLOFFS, Exponential, Falloff, Length, Tabulated
from obscurance.ao.mu import MAX_KNOTS
from obscurance.raytrace.errors import ConflictError, InputError, OptionError, nearest_name
from obscurance.raytrace.system.checks import check_regular

from .formats.load import parser_errors

if TYPE_CHECKING:
    from .formats.stored_w import Scales

_TABLE = "table:"
_ENDINGS = ".csv", ".txt", ".npy"
_MOST = 1 << 24  # bytes of a table's file


def table_of(form: str, locate: Callable[[str], Path] = Path) -> list[Path]:
    """The file of the form "table:FILE", as `locate` finds it; no file of other forms."""
    return [locate(form.removeprefix(_TABLE))] if form.startswith(_TABLE) else []


def make_falloff(
    form: str,
    tau: float | None = None,
    half_distance: Length | None = None,
    max_distance: Length | None = None,
    locate: Callable[[str], Path] = Path,
) -> Falloff:
    """The falloff of these options; `locate` finds the file of "table:FILE". Raises: InputError."""
    limit = math.inf if max_distance is None else max_distance
    if form == "exponential":
        return Exponential(tau, half_distance, limit)
    table = table_of(form, locate)
    if form not in FALLOFFS and not table:
        expected = f"one of {', '.join(FALLOFFS)}, {_TABLE}FILE"
        raise OptionError("falloff", expected, form, nearest=nearest_name(form, FALLOFFS))
    for name, value in (("tau", tau), ("half_distance", half_distance)):
        if value is not None:
            raise ConflictError(name, "needs", ("falloff", "exponential"))
    if not table:
        if str(limit) == "inf" and not hasattr(FALLOFFS[form], "max_distance"):  # which has no default
            raise ConflictError(("falloff", form), "needs", "max_distance")
        named: Falloff = FALLOFFS[form](max_distance=limit)
        return named
    if str(limit) != "inf":
        raise ConflictError("max_distance", "does not go with", "a table, which ends where μ is 1")
    return read_table(table[0])


def make_scales(half_distance: Length, power: float | str | None = None) -> Scales:
    """The scales of these options: one length and power, or several in a text with commas. Raises: OptionError."""
    lengths = str(half_distance).split(",")
    for length in lengths:
        Exponential(half_distance=length)
    try:
        powers = [1.0] * len(lengths) if power is None else [float(text) for text in str(power).split(",")]
    except ValueError:
        powers = []
    if len(powers) != len(lengths) or not all(0 < value < math.inf for value in powers):
        one_for_each = "one for each half-distance: " if len(lengths) > 1 else ""
        raise OptionError("power", f"{one_for_each}a number above 0, such as 1 or 0.5", repr(power))
    from .formats.stored_w import Scales

    return Scales(tuple(lengths), tuple(powers))


def read_table(path: Path) -> Tabulated:
    """The two columns of a CSV, text or `.npy` file: distances in mesh units or, as "25%", of the radius; and μ.

    Columns of text are separated by commas, semicolons or blanks; a line of names may stand above, "#" begins remarks.
    """
    if path.suffix.lower() not in _ENDINGS:
        raise InputError(path, "file", "a table, a name ending in " + ", ".join(_ENDINGS), path.name)
    check_regular(path, "a table of distances and values")
    with parser_errors(path, InputError, "two columns, distances and values"):
        if path.stat().st_size > _MOST:
            raise InputError(path, "content", f"at most {MAX_KNOTS:,} rows", f"{path.stat().st_size:,} bytes")
        knots = _array(path) if path.suffix.lower() == ".npy" else _text(path)
    try:
        return Tabulated([distance for distance, _ in knots], [value for _, value in knots])
    except OptionError as fault:
        raise InputError(path, fault.field, fault.expected, fault.got) from None


def _array(path: Path) -> Any:
    """The rows (k, 2) of a `.npy` file. Raises: ValueError: another shape or type."""
    values = np.load(path, allow_pickle=False)
    if not isinstance(values, np.ndarray) or values.ndim != 2 or values.shape[1] != 2 or values.dtype.kind not in "fiu":
        raise ValueError(f"shape {getattr(values, 'shape', '?')} of {getattr(values, 'dtype', '?')}")
    return values.astype(np.float64).tolist()


def _text(path: Path) -> list[tuple[str, float]]:
    """The rows of a text file: a distance as written, and a value. Raises: InputError naming the line."""
    knots: list[tuple[str, float]] = []
    for number, line in enumerate(path.read_text("utf-8-sig").splitlines(), 1):
        cells = re.split(r"\s*[,;]\s*|\s+", line.partition("#")[0].strip())
        if cells == [""]:
            continue
        try:
            distance, value = cells
            float(distance.removesuffix("%"))
            knots.append((distance, float(value)))
        except ValueError:
            if knots or len(cells) != 2 or any(character.isdigit() for character in line):
                raise InputError(path, f"line {number}", "a distance and a value", repr(line)) from None
    return knots
