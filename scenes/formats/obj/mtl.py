"""Material libraries of OBJ files, as far as glTF's metallic-roughness materials and Blinn–Phong hold them.

`Kd` with `map_Kd`, `d` or `Tr` with `map_d`, `Ke`, and `Pm`, `Pr` or else `Ks` with `Ns`, whose Blinn–Phong exponent
becomes the roughness (2 / (Ns + 2))^¼ (Walter et al. 2007: α² = 2 / (Ns + 2); glTF: α = roughness²). `Tr`, which the
format does not have, is 1 − d; MeshLab, 3ds Max and mvs-texturing write 1 for what is opaque.
Format: Wavefront MTL 5.0, 1995; the PBR extension of Clara.io, 2014.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from obscurance.raytrace.errors import first_names, printable

from ...asset.material import Material, is_opacity_map, is_picture, picture
from .text import joined_lines

_NAMES, _NAME = 3, 60  # of libraries or materials that a message lists, and letters of each
_LIBRARY = re.compile(r"^[ \t]*mtllib(?!\S)([^#\n]*)", re.MULTILINE)
OPAQUE, OPTION, LIBRARY = "Tr 1", "option", "material library"  # how words on them begin
MATERIAL_WORDS = ("texture of", LIBRARY, OPAQUE, OPTION)  # how what is missing of materials begins
_STEEPEST = 1e6  # exponent of a highlight
_NUMBERS = {  # how many numbers a statement has, and the largest that they may be
    "Kd": (3, 1), "Ke": (3, 1), "Ks": (3, 1), "d": (1, 1), "Tr": (1, 1), "Ns": (1, _STEEPEST), "Pm": (1, 1),
    "Pr": (1, 1),
}  # fmt: skip
_MAPS = "map_Kd", "map_d"
_UNREAD = "map_", "bump", "disp", "decal", "refl", "norm"
_LARGEST = 1 << 24  # bytes of a library
_OPTION = r"(?i)-(?:mm\s+\S+\s+\S+|[ost](?:\s+[-+.\de]+(?=\s)){1,3}|[a-z]+\s+\S+)\s+"
_IDLE = (  # options at their defaults, and options of filters and bumps
    r"(?i)-(?:s(\s+1(\.0*)?)+|[ot](\s+0(\.0*)?)+|mm\s+0(\.0*)?\s+1(\.0*)?|(clamp|cc)\s+off"
    r"|(blendu|blendv|bm|boost|texres)\s+\S+)\s+"
)


Libraries = tuple[dict[str, Material], list[Path], list[str]]
"""The materials of libraries by name, the files they come from, and what was left out, in words."""


def read_libraries(names: str, folder: Path) -> Libraries:
    """The libraries of an OBJ file.

    Args: names: what follows each `mtllib`, a statement a line. folder: of the OBJ file.
    """
    known: dict[str, Material] = {}
    files: list[Path] = []
    left: list[str] = []
    find = partial(_resolve_inside, folder)
    libraries = list(_libraries(names.split("\n"), find))
    if gone := dict.fromkeys(name for name, library in libraries if library is None):
        left.append(f"{LIBRARY} {first_names([printable(name, _NAME) for name in gone], _NAMES)}")
    for library in (library for _, library in libraries if library):
        materials, missing = read_mtl(library, find)
        known = materials | known  # the first of a name counts
        files.append(library)
        for material in materials.values():
            files += material.pictures
        left += missing
    return known, files, left


def named_files(path: Path) -> list[Path]:
    """Material libraries of an OBJ file and their pictures, used or not, as far as they exist."""
    find = partial(_resolve_inside, path.parent)
    lines = _LIBRARY.findall(joined_lines(path.read_bytes()))
    libraries = [library for _, library in _libraries(lines, find) if library]
    statements = [statement for library in libraries for statement in _statements(library)]
    pictures = [find(_picture(rest)[0]) for key, rest in statements if key in _MAPS]
    return list(dict.fromkeys(filter(None, libraries + pictures)))


def _libraries(lines: Iterable[str], find: Callable[[str], Path | None]) -> Iterator[tuple[str, Path | None]]:
    """The names of libraries behind each `mtllib`, and their files, None for those that are missing."""
    for line in filter(None, map(str.strip, lines)):
        for name in [line] if find(line) else dict.fromkeys(line.split()):
            yield name, find(name)


def _resolve_inside(folder: Path, name: str) -> Path | None:
    """A file in a folder or below it, or None."""
    from ...safe_paths import resolve_inside

    return resolve_inside(name.strip().strip('"'), folder)


def read_mtl(path: Path, find: Callable[[str], Path | None]) -> tuple[dict[str, Material], list[str]]:
    """The materials of a library by name, and what of it was left out, in words; `find` finds files."""
    statements_of: dict[str, dict[str, Any]] = {}
    left = []
    statements: dict[str, Any] | None = None
    for key, rest in _statements(path):
        if key == "newmtl" and rest:
            statements = statements_of[rest] = {}
        elif statements is None:
            continue
        elif key in _NUMBERS:
            statements[key] = _numbers(rest, *_NUMBERS[key])
        elif key in _MAPS:
            name, options = _picture(rest)
            image = statements[key] = find(name)
            left += [f"{OPTION} {option} of {key} ({name})" for option in options if image]
            if not image or (key == "map_Kd" and not is_picture(image)):
                left.append(f"texture of {key} ({rest or 'no name'})")
                del statements[key]
        elif key.startswith(_UNREAD):
            left.append(f"texture of {key} ({rest or 'no name'})")
    # The materials, and what could not be taken over.
    materials = {name: _material(name, values) for name, values in statements_of.items()}
    for name, values in statements_of.items():
        if "map_d" in values and not materials[name].opacity_texture:
            left.append(f"texture of map_d ({values['map_d'].name})")
    if opaque := [name for name, values in statements_of.items() if _is_opaque(values)]:
        left.append(f"{OPAQUE} of {first_names(opaque, _NAMES)}, taken for opaque")
    return materials, left


def _statements(path: Path) -> Iterator[tuple[str, str]]:
    """Keywords of a library, and what follows them on the line."""
    for line in joined_lines(path.read_bytes()[:_LARGEST]).split("\n"):
        key, rest = [*line.partition("#")[0].strip().split(maxsplit=1), "", ""][:2]
        yield key, rest


def _picture(text: str) -> tuple[str, list[str]]:
    """The name at the end of a texture's statement, and the options before it that change what is shown."""
    options = []
    while option := re.match(_OPTION, text):
        text = text[option.end() :]
        options += [] if re.fullmatch(_IDLE, option[0]) else [option[0].strip()]
    return text, options


def _is_opaque(statements: dict[str, Any]) -> bool:
    """Whether `Tr` would hide everything."""
    return not statements.get("d") and statements.get("Tr") == (1.0,)


def _numbers(text: str, count: int, largest: float) -> tuple[float, ...]:
    """So many numbers in [0, largest], of which one stands for all; none if there are others."""
    try:
        values = np.array([float(word) for word in text.split()[:count]])
    except ValueError:
        return ()
    if len(values) not in (1, count) or not np.isfinite(values).all():
        return ()
    return tuple(np.broadcast_to(values, count).clip(0, largest).tolist())


def _material(name: str, statements: dict[str, Any]) -> Material:
    """A material from its statements, by keyword. Its roughness is that of the exponent `Ns`."""

    def number(key: str, otherwise: float = 0.0) -> float:
        return statements[key][0] if statements.get(key) else otherwise

    black = 0.0, 0.0, 0.0
    specular = statements.get("Ks") or black
    exponent = number("Ns")
    glossy = (2 / (exponent + 2)) ** 0.25 if statements.get("Ns") and any(specular) else 1.0
    texture = statements.get("map_Kd")
    opacity_texture = statements.get("map_d")
    if opacity_texture and not is_opacity_map(opacity_texture, texture):
        opacity_texture = None
    opacity = 1.0 if _is_opaque(statements) else number("d", 1 - number("Tr"))
    return Material(
        name,
        statements.get("Kd") or (1.0, 1.0, 1.0),
        opacity=opacity,
        alpha="blend" if opacity < 1 or opacity_texture else "opaque",
        metallic=number("Pm"),
        roughness=number("Pr", glossy),
        emission=statements.get("Ke") or black,
        specular=specular,
        exponent=exponent,
        texture=picture(texture),
        opacity_texture=picture(opacity_texture),
    )
