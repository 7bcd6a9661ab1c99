"""Material libraries of OBJ files, as far as glTF's metallic-roughness materials hold them.

`Kd` with `map_Kd`, `d` or `Tr` with `map_d`, `Ke`, and `Pm`, `Pr` or else `Ks` with `Ns`, whose Blinn–Phong exponent
becomes the roughness (2 / (Ns + 2))^¼ (Walter et al. 2007: α² = 2 / (Ns + 2); glTF: α = roughness²).
`Tr`, which the format does not have, is 1 − d; MeshLab, 3ds Max and mvs-texturing write 1 for what is opaque.
Format: Wavefront MTL 5.0, 1995; the PBR extension of Clara.io, 2014.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...geometry.detail import Paint
from .text import joined_lines

OPAQUE, OPTION = "Tr 1", "option"  # how words on them begin
_COUNTS = {"Kd": 3, "Ke": 3, "Ks": 3, "d": 1, "Tr": 1, "Ns": 1, "Pm": 1, "Pr": 1}  # numbers of a statement
_MAPS = "map_Kd", "map_d"
_PICTURES = (b"\x89PNG", b"\xff\xd8\xff")
_LARGEST = 1 << 24  # bytes of a library
_OPTION = r"(?i)-(?:mm\s+\S+\s+\S+|[ost](?:\s+[-+.\de]+(?=\s)){1,3}|[a-z]+\s+\S+)\s+"
_IDLE = (  # options at their defaults, and options of filters and bumps
    r"(?i)-(?:s(\s+1(\.0*)?)+|[ot](\s+0(\.0*)?)+|mm\s+0(\.0*)?\s+1(\.0*)?|(clamp|cc)\s+off"
    r"|(blendu|blendv|bm|boost|texres)\s+\S+)\s+"
)


def read_mtl(path: Path, beside: Callable[[str], Path | None]) -> tuple[dict[str, Paint], list[str]]:
    """The materials of a library by name, and what of it was left out, in words.

    Args: beside: finds the file that a name means, or None.
    """
    given: dict[str, dict[str, Any]] = {}
    left = []
    name = ""
    for key, rest in _statements(path):
        if key == "newmtl" and rest:
            name = rest
            given[name] = {}
        elif name and key in _COUNTS:
            given[name][key] = _numbers(rest, _COUNTS[key])
        elif name and key in _MAPS:
            picture, options = _picture(rest)
            given[name][key] = beside(picture)
            left += [f"{OPTION} {option} of {key} ({picture})" for option in options if given[name][key]]
            if given[name][key] is None or (key == "map_Kd" and not _starts(given[name][key]).startswith(_PICTURES)):
                left.append(f"texture of {key} ({rest or 'no name'})")
                del given[name][key]
        elif name and key.startswith(("map_", "bump", "disp", "decal", "refl", "norm")):
            left.append(f"texture of {key} ({rest or 'no name'})")
    made = {name: _paint(name, values) for name, values in given.items()}
    unread = [each["map_d"] for name, each in given.items() if "map_d" in each and not made[name].opacity_texture]
    left += [f"texture of map_d ({picture.name})" for picture in unread]
    opaque = [name for name, values in given.items() if _is_opaque(values)]
    if opaque:
        more = f" and {len(opaque) - 3:,} more" if len(opaque) > 3 else ""
        left.append(f"{OPAQUE} of {', '.join(opaque[:3])}{more}, taken for opaque")
    return made, left


def named_pictures(path: Path, beside: Callable[[str], Path | None]) -> list[Path]:
    """The pictures that `read_mtl` looks at. Args: as of that."""
    found = (beside(_picture(rest)[0]) for key, rest in _statements(path) if key in _MAPS)
    return [picture for picture in found if picture]


def _statements(path: Path) -> Iterator[tuple[str, str]]:
    """Keywords of a library, and what follows them on the line."""
    for line in joined_lines(path.read_bytes()[:_LARGEST]).split("\n"):
        key, rest = [*line.partition("#")[0].strip().split(maxsplit=1), "", ""][:2]
        yield key, rest


def _picture(text: str) -> tuple[str, list[str]]:
    """The name at the end of a texture's statement, and the options before it that change what is shown."""
    options = []
    while found := re.match(_OPTION, text):
        text = text[found.end() :]
        options += [] if re.fullmatch(_IDLE, found[0]) else [found[0].strip()]
    return text, options


def _is_opaque(given: dict[str, Any]) -> bool:
    """Whether `Tr` would hide everything."""
    return not given.get("d") and bool(given.get("Tr")) and given["Tr"][0] >= 1


def _numbers(text: str, count: int) -> tuple[float, ...] | None:
    try:
        values = [float(word) for word in text.split()[:count]]
    except ValueError:
        return None
    if len(values) == 1:
        values *= count
    return tuple(values) if len(values) == count and np.isfinite(values).all() else None


def _starts(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(8)


def _paint(name: str, given: dict[str, Any]) -> Paint:
    def fraction(key: str, otherwise: float) -> float:
        return float(np.clip(given[key][0], 0, 1)) if given.get(key) else otherwise

    def colour(key: str, otherwise: float) -> tuple[float, float, float]:
        red, green, blue = np.clip(given.get(key) or (otherwise,) * 3, 0, 1).tolist()
        return red, green, blue

    paint = Paint(name, colour("Kd", 1.0), emission=colour("Ke", 0.0), texture=given.get("map_Kd"))
    roughness = fraction("Pr", 1.0)
    if not given.get("Pr") and given.get("Ns") and any(given.get("Ks") or (0,)):
        roughness = float((2 / (max(given["Ns"][0], 0) + 2)) ** 0.25)
    opacity = 1.0 if _is_opaque(given) else fraction("d", 1 - fraction("Tr", 0.0))
    mapped = given.get("map_d")
    if mapped:
        from ...geometry.opacity import is_opacity_map

        paint = replace(paint, opacity_texture=mapped if is_opacity_map(mapped, paint.texture) else None)
    return replace(paint, opacity=opacity, metallic=fraction("Pm", 0.0), roughness=roughness)
