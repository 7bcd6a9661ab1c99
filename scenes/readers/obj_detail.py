"""Colours, texture coordinates and materials of an OBJ file, and in words what is not kept."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from raytrace.types import Float64s, Int64s

from ..geometry.detail import Detail, Paint, PerCorner
from ..geometry.polygons import Triangles
from .mtl import OPAQUE, read_mtl
from .obj_text import ObjText, statements

PAINT_WORDS = ("texture of", "material library", OPAQUE)  # how what is missing of materials begins
_COLOURED = statements("v", r"(\S+(?:[ \t]+\S+){5})[ \t]*(?:#.*)?$")
_LIBRARY = statements("mtllib", r"([^#\n]+)")
_USED = statements("(f|usemtl)")
_SMOOTHED = statements("s", r"(\S+)")
_NAMED = statements("[og]", r"([^#\n]*\S)")
_OTHER = statements("(?:l|p|curv|curv2|surf)", "")
_SOME_UV = re.compile(r"[^/\s]/[^/\s]")
_SOME_NORMAL = re.compile(r"/[^/\s]*/[^/\s]")


def obj_detail(
    file: ObjText, folder: Path, triangles: Triangles, normals: PerCorner | None, one_each: bool
) -> tuple[Detail, tuple[str, ...]]:
    """All of an OBJ file that can be kept, and the rest in words.

    Args:
        folder: where the file is; its material libraries and their images are there or below.
        triangles: of its faces. normals: of all corners. one_each: whether no vertex has several of them.
    """
    text, uv = file.text, file.uv()
    colors = _colors(text, len(file.vertices))
    finite = uv is None or bool(np.isfinite(uv.rows).all())
    left_out = (
        (len(set(_NAMED.findall(text))) > 1, "names of objects and groups"),
        (len(set(_SMOOTHED.findall(text))) > 1, "smoothing groups"),
        (_OTHER.search(text), "lines, points, curves and surfaces"),
        (uv is None and _SOME_UV.search(file.faces), "texture coordinates, which some corners lack"),
        (normals is None and _SOME_NORMAL.search(file.faces), "normals, which some corners lack"),
        (not finite, "texture coordinates, some of which are not finite"),
        (colors is None and _COLOURED.search(text), "colours, which some vertices lack or have outside of [0, 1]"),
    )
    paints, paint_of, files, missing = _paints(text, folder, len(file.sizes))
    detail = Detail(
        file.corners,
        file.sizes,
        triangles,
        uv if finite else None,
        None if one_each else normals,
        colors,
        paints=paints,
        paint_of=paint_of,
        files=files,
    )
    return detail, (*(words for is_left_out, words in left_out if is_left_out), *missing)


def _colors(text: str, vertex_count: int) -> Float64s | None:
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
) -> tuple[tuple[Paint, ...], Int64s | None, tuple[Path, ...], list[str]]:
    """Materials, which of them each face has, the files they come from, and what was left out."""
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
    if not names:
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
            pictures = [picture for paint in more.values() for picture in (paint.texture, paint.opacity_texture)]
            files += [library, *filter(None, pictures)]
            left += missing
    paints = tuple(known.get(name, Paint(name)) for name in names)
    return paints, of, tuple(files), left
