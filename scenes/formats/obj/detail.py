"""Colours, texture coordinates and materials of an OBJ file, its faces' alpha, and in words what is not kept.

Of material libraries, as far as glTF's metallic-roughness materials hold them: `Kd` with `map_Kd`, `d` or `Tr` with
`map_d`, `Ke`, and `Pm`, `Pr` or else `Ks` with `Ns`, whose Blinn–Phong exponent becomes the roughness (2 / (Ns + 2))^¼
(Walter et al. 2007: α² = 2 / (Ns + 2); glTF: α = roughness²). `Tr`, which the format does not have, is 1 − d; MeshLab,
3ds Max and mvs-texturing write 1 for what is opaque.
Format: Wavefront MTL 5.0, 1995; the PBR extension of Clara.io, 2014.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from raytrace.errors import printable
from raytrace.mesh.opacity import AlphaSurface, Opacity

from ...geometry.detail import Detail, Paint, PerCorner, is_opacity_map
from ...geometry.polygons import Triangulation
from ...safe_paths import beside
from .text import ObjText, joined_lines

_NAMES, _NAME = 3, 60  # of libraries or materials that a message lists, and letters of each
MAX_OBJECTS = 4096  # each takes a kilobyte or two of a .glb
_LIBRARY = re.compile(r"^[ \t]*mtllib(?!\S)([^#\n]*)", re.MULTILINE)
_OTHER = "l", "p", "curv", "curv2", "surf"
OPAQUE, OPTION, LIBRARY = "Tr 1", "option", "material library"  # how words on them begin
PAINT_WORDS = ("texture of", LIBRARY, OPAQUE, OPTION)  # how what is missing of materials begins
_COUNTS = {"Kd": 3, "Ke": 3, "Ks": 3, "d": 1, "Tr": 1, "Ns": 1, "Pm": 1, "Pr": 1}  # numbers of a statement
_MAPS = "map_Kd", "map_d"
_UNREAD = "map_", "bump", "disp", "decal", "refl", "norm"
_PICTURES = (b"\x89PNG", b"\xff\xd8\xff")
_LARGEST = 1 << 24  # bytes of a library
_OPTION = r"(?i)-(?:mm\s+\S+\s+\S+|[ost](?:\s+[-+.\de]+(?=\s)){1,3}|[a-z]+\s+\S+)\s+"
_IDLE = (  # options at their defaults, and options of filters and bumps
    r"(?i)-(?:s(\s+1(\.0*)?)+|[ot](\s+0(\.0*)?)+|mm\s+0(\.0*)?\s+1(\.0*)?|(clamp|cc)\s+off"
    r"|(blendu|blendv|bm|boost|texres)\s+\S+)\s+"
)


def obj_detail(
    file: ObjText, folder: Path, triangles: Triangulation, normals: PerCorner | None, one_each: bool
) -> tuple[Detail, tuple[str, ...]]:
    """All of an OBJ file that can be kept, and the rest in words.

    Args: normals: of all corners. one_each: whether no vertex has several of them.
    """
    uv, colors = file.uv(), file.colors
    if colors is not None and not ((colors >= 0) & (colors <= 1)).all():
        colors = None
    by_object, by_group, painted = (file.named(keyword) for keyword in ("o", "g", "usemtl"))
    objects = by_group if by_object.kinds < 2 <= by_group.kinds or not by_object.names else by_object
    finite = uv is None or bool(np.isfinite(uv.rows[uv.of[file.some("vt")]]).all())
    left_out = (
        (by_object.kinds > 1 and by_group.kinds > 1, "names of groups"),
        (objects.kinds > MAX_OBJECTS, f"its division into {objects.kinds:,} objects"),
        (len(set(file.lines("s").split())) > 1, "smoothing groups"),
        (any(run.keyword in _OTHER for run in file.runs), "lines, points, curves and surfaces"),
        (normals is None and file.some("vn").any(), "normals, which some corners lack"),
        (not finite, "texture coordinates, some of which are not finite"),
        (colors is None and file.has_colors, "colours, which some vertices lack or have outside of [0, 1]"),
    )
    known, files, missing = _read_paints(file, folder) if painted.names else ({}, [], [])
    paints = tuple(known.get(name, Paint(name)) for name in painted.names)
    detail = Detail(file.corners, file.sizes, triangles, uv if finite else None, None if one_each else normals, colors)
    detail = replace(detail, paints=paints, paint_of=painted.of if paints else None, files=tuple(files))
    if objects.names and objects.kinds <= MAX_OBJECTS:
        detail = replace(detail, objects=objects.names, object_of=objects.of)
    return detail, (*(words for is_left_out, words in left_out if is_left_out), *missing)


def _read_paints(file: ObjText, folder: Path) -> tuple[dict[str, Paint], list[Path], list[str]]:
    """The materials of a file's libraries by name, the files they come from, and what was left out."""
    known: dict[str, Paint] = {}
    files: list[Path] = []
    left: list[str] = []
    find = partial(_beside, folder)
    libraries = list(_libraries(file.lines("mtllib").split("\n"), find))
    if gone := dict.fromkeys(name for name, library in libraries if library is None):
        left.append(f"{LIBRARY} {_first([printable(name, _NAME) for name in gone])}")
    for library in (library for _, library in libraries if library):
        more, missing = read_mtl(library, find)
        known = more | known
        pictures = [picture for paint in more.values() for picture in (paint.texture, paint.opacity_texture)]
        files += [library, *filter(None, pictures)]
        left += missing
    return known, files, left


def _first(names: list[str]) -> str:
    return ", ".join(names[:_NAMES]) + (f" and {len(names) - _NAMES:,} more" if len(names) > _NAMES else "")


def named_files(path: Path) -> list[Path]:
    """Material libraries of an OBJ file and their pictures, used or not, as far as they exist."""
    find = partial(_beside, path.parent)
    lines = _LIBRARY.findall(joined_lines(path.read_bytes()))
    libraries = [library for _, library in _libraries(lines, find) if library]
    statements = [each for library in libraries for each in _statements(library)]
    pictures = [find(_picture(rest)[0]) for key, rest in statements if key in _MAPS]
    return list(dict.fromkeys(filter(None, libraries + pictures)))


def _libraries(lines: Iterable[str], find: Callable[[str], Path | None]) -> Iterator[tuple[str, Path | None]]:
    """The names behind each `mtllib`, and their files, None for what is not there."""
    for line in filter(None, map(str.strip, lines)):
        for name in [line] if find(line) else dict.fromkeys(line.split()):
            yield name, find(name)


def _beside(folder: Path, name: str) -> Path | None:
    """A file in a folder or below it, or None."""
    return beside(name.strip().strip('"').replace("\\", "/"), folder)


def obj_opacity(file: ObjText, folder: Path, triangles: Triangulation) -> tuple[Opacity | None, tuple[str, ...]]:
    """Alpha of the faces, None where all are opaque; and warnings of images that are missing."""
    known, _, left = _read_paints(file, folder)
    told = {OPAQUE: "", LIBRARY: " is not there: what it paints is opaque", OPTION: " is not read"}
    told["texture of map_d"] = " is not read: alpha there is that of d alone"
    notes = tuple(
        words + end for words in dict.fromkeys(left) for begin, end in told.items() if words.startswith(begin)
    )
    paints = {name: paint for name, paint in known.items() if paint.opacity < 1 or paint.opacity_texture}
    if not paints:
        return None, notes
    painted = file.named("usemtl")
    of_name = [list(paints).index(name) if name in paints else -1 for name in painted.names]
    of = np.repeat(np.array([*of_name, -1])[painted.of], triangles.counts)
    if (of < 0).all():
        return None, notes
    from raytrace.image.texture import Texture

    uv = file.uv()
    coordinates = None if uv is None else uv.rows[triangles.take(uv.of)]
    surfaces = []
    for paint in paints.values():
        image = None if uv is None else paint.opacity_texture
        surfaces.append(AlphaSurface(paint.opacity, Texture(image) if image else None, grey=image != paint.texture))
    if coordinates is not None:
        lacking = np.isnan(coordinates).any(axis=(1, 2)) & (of >= 0)
        plain = [len(paints) + number if paint.opacity < 1 else -1 for number, paint in enumerate(paints.values())]
        of[lacking] = np.array(plain)[of[lacking]]
        surfaces += [AlphaSurface(paint.opacity) for paint in paints.values()]
        coordinates = np.nan_to_num(coordinates)
    return Opacity(of, tuple(surfaces), coordinates), notes


def read_mtl(path: Path, beside: Callable[[str], Path | None]) -> tuple[dict[str, Paint], list[str]]:
    """The materials of a library by name, and what of it was left out, in words; `beside` finds files."""
    given: dict[str, dict[str, Any]] = {}
    left = []
    own: dict[str, Any] | None = None
    for key, rest in _statements(path):
        if key == "newmtl" and rest:
            own = given[rest] = {}
        elif own is None:
            continue
        elif key in _COUNTS:
            own[key] = _numbers(rest, _COUNTS[key])
        elif key in _MAPS:
            picture, options = _picture(rest)
            own[key] = beside(picture)
            left += [f"{OPTION} {option} of {key} ({picture})" for option in options if own[key]]
            if not own[key] or (key == "map_Kd" and not _starts(own[key]).startswith(_PICTURES)):
                left.append(f"texture of {key} ({rest or 'no name'})")
                del own[key]
        elif key.startswith(_UNREAD):
            left.append(f"texture of {key} ({rest or 'no name'})")
    made = {name: _paint(name, values) for name, values in given.items()}
    unread = [each["map_d"] for name, each in given.items() if "map_d" in each and not made[name].opacity_texture]
    left += [f"texture of map_d ({picture.name})" for picture in unread]
    if opaque := [name for name, values in given.items() if _is_opaque(values)]:
        left.append(f"{OPAQUE} of {_first(opaque)}, taken for opaque")
    return made, left


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
        paint = replace(paint, opacity_texture=mapped if is_opacity_map(mapped, paint.texture) else None)
    return replace(paint, opacity=opacity, metallic=fraction("Pm", 0.0), roughness=roughness)
