"""What an OBJ file says besides vertices, triangles and one normal a vertex, and what nobody reads of it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..geometry.detail import Detail, Floats, Integers, Paint, PerCorner
from ..geometry.polygons import Triangles
from .mtl import read_mtl

PAINT_WORDS = ("texture of", "material library")  # how what is missing of materials begins
_COLOURED = re.compile(r"^[ \t]*v((?:[ \t]+\S+){6})[ \t]*(?:#.*)?$", re.MULTILINE)
_LIBRARY = re.compile(r"^[ \t]*mtllib[ \t]+([^#\n]+)", re.MULTILINE)
_USED = re.compile(r"^[ \t]*(f|usemtl)[ \t]+([^#\n]*)", re.MULTILINE)
_SMOOTHED = re.compile(r"^[ \t]*s[ \t]+(\S+)", re.MULTILINE)
_WITH_UV = re.compile(r"^[ \t]*f[ \t][^#\n]*[^/\s]/[^/\s]", re.MULTILINE)
_WITH_NORMAL = re.compile(r"^[ \t]*f[ \t][^#\n]*/[^/\s]*/[^/\s]", re.MULTILINE)
_NAMED = re.compile(r"^[ \t]*[og][ \t]+([^#\n]*\S)", re.MULTILINE)
_OTHER = re.compile(r"^[ \t]*(l|p|curv|curv2|surf)[ \t]", re.MULTILINE)


def obj_detail(
    text: str,
    folder: Path,
    corners: Integers,
    sizes: Integers,
    triangles: Triangles,
    uv: PerCorner | None,
    normals: PerCorner | None,
    has_normals: bool,
    vertex_count: int,
) -> tuple[Detail, tuple[str, ...]]:
    """All of an OBJ file that can be kept, and the rest in words.

    Args:
        text: of the file. folder: where it is; its material libraries and their pictures are there or below.
        corners, sizes: of its polygons. uv, normals: of their corners; has_normals: these, or one for each vertex.
    """
    unread = []
    names = set(_NAMED.findall(text))
    if len(names) > 1:
        unread.append("names of objects and groups")
    if len(set(_SMOOTHED.findall(text))) > 1:
        unread.append("smoothing groups")
    if _OTHER.search(text):
        unread.append("lines, points, curves and surfaces")
    if uv is None and _WITH_UV.search(text):
        unread.append("texture coordinates, which some corners lack")
    if not has_normals and _WITH_NORMAL.search(text):
        unread.append("normals, which some corners lack")
    if uv is not None and not np.isfinite(uv.rows).all():
        uv = None
        unread.append("texture coordinates, some of which are not finite")
    colors = _colors(text, vertex_count)
    if colors is None and _COLOURED.search(text):
        unread.append("colours, which some vertices lack or have outside of [0, 1]")
    paints, paint_of, files, left = _paints(text, folder, len(sizes))
    detail = Detail(corners, sizes, triangles, uv, normals, colors, {}, paints, paint_of, files=files)
    return detail, (*unread, *left)


def _colors(text: str, vertex_count: int) -> Floats | None:
    """Red, green and blue behind the coordinates of every vertex, as many programs write them."""
    rows = _COLOURED.findall(text)
    if not rows or len(rows) != vertex_count:
        return None
    try:
        colors = np.fromstring(" ".join(rows), sep=" ").reshape(vertex_count, 6)[:, 3:]
    except ValueError:
        return None
    return colors if (colors >= 0).all() and (colors <= 1).all() else None


def _paints(
    text: str, folder: Path, count: int
) -> tuple[tuple[Paint, ...], Integers | None, tuple[Path, ...], list[str]]:
    """Materials, which of them each face has, the files they come from, and what was left out."""
    used: list[str] = []
    names: dict[str, int] = {}
    of = np.full(count, -1, np.int64)
    face, current = 0, -1
    for keyword, rest in _USED.findall(text) if "usemtl" in text else ():
        if keyword == "usemtl":
            name = rest.strip()
            current = names.setdefault(name, len(names))
        elif face < count:
            of[face] = current
            face += 1
    used = list(names)
    if not used:
        return (), None, (), []
    known: dict[str, Paint] = {}
    files: list[Path] = []
    left: list[str] = []

    def beside(name: str) -> Path | None:
        try:
            root = folder.resolve()
            target = (root / name.strip().strip('"').replace("\\", "/")).resolve()
            return target if target.is_relative_to(root) and target.is_file() else None
        except (OSError, ValueError):
            return None

    for line in _LIBRARY.findall(text):
        found = [beside(line)] if beside(line) else [beside(name) for name in line.split()]
        for library in found:
            if library is None:
                left.append(f"material library {line.strip()}")
                continue
            more, missing = read_mtl(library, beside)
            known = more | known
            files += [library, *(paint.texture for paint in more.values() if paint.texture)]
            left += missing
    paints = tuple(known.get(name, Paint(name)) for name in used)
    return paints, of, tuple(files), left
