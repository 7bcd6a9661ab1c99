"""Material libraries of OBJ files, as far as glTF's metallic-roughness materials hold them.

`Kd` with `map_Kd`, `d` or `Tr`, `Ke`, and `Pm`, `Pr` or else `Ks` with `Ns`, whose Blinn–Phong exponent becomes the
roughness (2 / (Ns + 2))^¼ (Walter et al. 2007: α² = 2 / (Ns + 2); glTF: α = roughness²).
Format: Wavefront MTL 5.0, 1995; the PBR extension of Clara.io, 2014.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..geometry.detail import Paint

_PICTURES = (b"\x89PNG", b"\xff\xd8\xff")
_LARGEST = 1 << 24  # bytes of a library


def read_mtl(path: Path, beside: Callable[[str], Path | None]) -> tuple[dict[str, Paint], list[str]]:
    """The materials of a library by name, and what of it was left out, in words.

    Args: beside: finds the file that a name means, or None.
    """
    content = path.read_bytes()[:_LARGEST].decode("utf-8", "replace").replace("\r", "\n").replace("\\\n", " ")
    made: dict[str, Paint] = {}
    given: dict[str, dict[str, Any]] = {}
    left = []
    name = ""
    for line in content.split("\n"):
        key, _, rest = line.partition("#")[0].strip().partition(" ")
        rest = rest.strip()
        if key == "newmtl" and rest:
            name = rest
            given[name] = {}
        elif name and key in ("Kd", "Ke", "Ks"):
            given[name][key] = _numbers(rest, 3)
        elif name and key in ("d", "Tr", "Ns", "Pm", "Pr"):
            given[name][key] = _numbers(rest, 1)
        elif name and key == "map_Kd":
            found = beside(rest.split()[-1] if rest.startswith("-") else rest)
            with_picture = found and _starts(found).startswith(_PICTURES)
            given[name][key] = found if with_picture else None
            if not with_picture:
                left.append(f"texture of {key} ({rest or 'no name'})")
        elif name and key.startswith(("map_", "bump", "disp", "decal", "refl", "norm")):
            left.append(f"texture of {key} ({rest or 'no name'})")
    for name, values in given.items():
        made[name] = _paint(name, values)
    return made, left


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
    opacity = fraction("d", 1 - fraction("Tr", 0.0))
    return replace(paint, opacity=opacity, metallic=fraction("Pm", 0.0), roughness=roughness)
