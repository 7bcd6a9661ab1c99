"""Choices of the command's options, and their parsing. Heavy imports wait until one is used."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

CAGE = "2%"  # of the radius, unless --cage is given
REPORTS = ".json", ".html"  # endings
VALIDATION_SAMPLES = 4096  # rays per vertex of `obscurance validate`, unless given


Traversal = Literal["auto", "embree"]
Method = Literal["vertex", "surface"]
FALLOFFS = "exponential", "binary", "linear", "smooth", "table:"
Hidden = Literal["auto", "ignore", "mark", "fill"]
NormalsFrom = Literal["angle", "area", "equal", "file"]
Metric = Literal["flip", "rms", "max"]
Alpha = Literal["auto", "ignore"]
Up = Literal["x", "y", "z", "-x", "-y", "-z"]
Occlusion = Literal["none", "ramp", "texture", "auto"]
Format = Literal["npy", "npz", "ply", "glb", "html", "png", "exr", "tif"]
InputFormat = Literal["ply", "obj", "stl", "off", "glb", "gltf", "3mf"]
ProgressForm = Literal["bar", "json"]
Overlap = Literal["mean", "first", "refuse"]
BentSpace = Literal["world", "tangent"]


@contextmanager
def named(option: str) -> Iterator[None]:
    """Errors raised within about the option `option`, whatever the function called has for a name."""
    from raytrace.errors import OptionError

    try:
        yield
    except OptionError as fault:
        raise OptionError(option, fault.expected, fault.got, nearest=fault.nearest) from None


def parse_crop(text: str) -> tuple[int, int, int, int]:
    """Left, top, width and height of "X,Y,W,H". Raises: OptionError."""
    from raytrace.errors import OptionError

    try:
        x, y, width, height = (int(part) for part in text.split(","))
    except ValueError:
        raise OptionError("crop", "four whole numbers X,Y,W,H", repr(text)) from None
    return x, y, width, height


def parse_size(width: int | None, height: int | None) -> tuple[int, int] | None:
    """Both or neither. Raises: OptionError."""
    from raytrace.errors import OptionError

    if width is None and height is None:
        return None
    if width is None or height is None:
        missing = "width" if width is None else "height"
        raise OptionError(missing, "--width and --height together", "one of them")
    return width, height


def parse_texels(text: str) -> int | tuple[int, int]:
    """A side, or the width and height of "WxH". Raises: OptionError."""
    from raytrace.errors import OptionError

    try:
        sides = [int(part) for part in text.lower().split("x")]
    except ValueError:
        sides = []
    if len(sides) not in (1, 2):
        raise OptionError("size", "a number of texels, such as 1024, or WIDTHxHEIGHT", repr(text))
    return sides[0] if len(sides) == 1 else (sides[0], sides[1])


def check_cage(cage: str | None, high: Path | None) -> None:
    """Raises: OptionError: a cage that is no length, or without a fine mesh."""
    if cage is None:
        return
    from ao.falloff import resolve_length
    from raytrace.errors import OptionError

    if high is None:
        raise OptionError("cage", "--high with it", "none")
    if resolve_length("cage", cage, 1.0) == float("inf"):
        raise OptionError("cage", "a finite length", cage)


def plain(value: object) -> object:
    """An option as a JSON report has it."""
    return str(value) if isinstance(value, Path) else value
