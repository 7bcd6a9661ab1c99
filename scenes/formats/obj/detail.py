"""Colours, texture coordinates and materials of an OBJ file, its faces' alpha, and in words what is not kept."""

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from raytrace.errors import printable
from raytrace.mesh.opacity import AlphaSurface, Opacity

from ...geometry.detail import Detail, Paint, PerCorner
from ...geometry.polygons import Triangulation
from ...safe_paths import beside
from .mtl import OPAQUE, OPTION, named_pictures, read_mtl
from .text import ObjText, joined_lines

PAINT_WORDS = ("texture of", "material library", OPAQUE, OPTION)  # how what is missing of materials begins
_NAMES, _NAME = 3, 60  # missing libraries that a message lists, and letters of each
MAX_OBJECTS = 4096  # each takes a kilobyte or two of a .glb
_LIBRARY = re.compile(r"^[ \t]*mtllib(?!\S)([^#\n]*)", re.MULTILINE)
_OTHER = "l", "p", "curv", "curv2", "surf"


def obj_detail(
    file: ObjText, folder: Path, triangles: Triangulation, normals: PerCorner | None, one_each: bool
) -> tuple[Detail, tuple[str, ...]]:
    """All of an OBJ file that can be kept, and the rest in words.

    Args:
        folder: where the file is; its material libraries and their images are there or below.
        triangles: of its faces. normals: of all corners. one_each: whether no vertex has several of them.
    """
    uv, colors = file.of_corners("vt"), file.colors
    if colors is not None and not ((colors >= 0) & (colors <= 1)).all():
        colors = None
    by_object, by_group, painted = (file.named(keyword) for keyword in ("o", "g", "usemtl"))
    objects = by_group if by_object.kinds < 2 <= by_group.kinds or not by_object.names else by_object
    has_some_uv = uv is None and bool(file.some("vt").any())
    finite = uv is None or bool(np.isfinite(uv.rows).all())
    left_out = (
        (by_object.kinds > 1 and by_group.kinds > 1, "names of groups"),
        (objects.kinds > MAX_OBJECTS, f"its division into {objects.kinds:,} objects"),
        (len(set(file.lines("s").split())) > 1, "smoothing groups"),
        (any(run.keyword in _OTHER for run in file.runs), "lines, points, curves and surfaces"),
        (has_some_uv, "texture coordinates, which some corners lack"),
        (normals is None and file.some("vn").any(), "normals, which some corners lack"),
        (not finite, "texture coordinates, some of which are not finite"),
        (colors is None and file.has_colors, "colours, which some vertices lack or have outside of [0, 1]"),
    )
    known, files, missing = _read_paints(file, folder) if painted.names else ({}, [], [])
    paints = tuple(known.get(name, Paint(name)) for name in painted.names)
    is_divided = objects.names and objects.kinds <= MAX_OBJECTS
    detail = Detail(
        file.corners,
        file.sizes,
        triangles,
        uv if finite else None,
        None if one_each else normals,
        colors,
        paints=paints,
        paint_of=painted.of if paints else None,
        objects=objects.names if is_divided else (),
        object_of=objects.of if is_divided else None,
        files=tuple(files),
        some_uv=file.some_uv() if has_some_uv else None,
    )
    return detail, (*(words for is_left_out, words in left_out if is_left_out), *missing)


def _read_paints(file: ObjText, folder: Path) -> tuple[dict[str, Paint], list[Path], list[str]]:
    """The materials of a file's libraries by name, the files they come from, and what was left out."""
    known: dict[str, Paint] = {}
    files: list[Path] = []
    left: list[str] = []
    gone: dict[str, None] = {}
    find = partial(_beside, folder)
    for name, library in _libraries(file.lines("mtllib").split("\n"), find):
        if library is None:
            gone[name] = None
            continue
        more, missing = read_mtl(library, find)
        known = more | known
        pictures = [picture for paint in more.values() for picture in (paint.texture, paint.opacity_texture)]
        files += [library, *filter(None, pictures)]
        left += missing
    if gone:
        first = ", ".join(printable(name, _NAME) for name in list(gone)[:_NAMES])
        rest = f" and {len(gone) - _NAMES:,} more" if len(gone) > _NAMES else ""
        left.insert(0, f"material library {first}{rest}")
    return known, files, left


def named_files(path: Path) -> list[Path]:
    """Material libraries of an OBJ file and their pictures, used or not, as far as they exist."""
    find = partial(_beside, path.parent)
    lines = _LIBRARY.findall(joined_lines(path.read_bytes()))
    libraries = [library for _, library in _libraries(lines, find) if library]
    pictures = [picture for library in libraries for picture in named_pictures(library, find)]
    return list(dict.fromkeys(libraries + pictures))


def _libraries(lines: Iterable[str], find: Callable[[str], Path | None]) -> Iterator[tuple[str, Path | None]]:
    """The names behind each `mtllib`, and their files, None for what is not there."""
    for line in filter(None, map(str.strip, lines)):
        for name in [line] if find(line) else dict.fromkeys(line.split()):
            yield name, find(name)


def _beside(folder: Path, name: str) -> Path | None:
    """A file in a folder or below it, or None."""
    return beside(name.strip().strip('"').replace("\\", "/"), folder)


def obj_opacity(file: ObjText, folder: Path, triangles: Triangulation) -> tuple[Opacity | None, tuple[str, ...]]:
    """Alpha of the faces, None where all are opaque; and warnings of images that are missing.

    Args: folder: where the file is. triangles: of its polygons.
    """
    known, _, left = _read_paints(file, folder)
    missing = [words for words in left if "map_d" in words]
    without = {words: "" if words.startswith(OPTION) else ": alpha there is that of d alone" for words in missing}
    notes = tuple(f"{words} is not read{instead}" for words, instead in without.items())
    paints = {name: paint for name, paint in known.items() if paint.opacity < 1 or paint.opacity_texture}
    if not paints:
        return None, notes
    painted = file.named("usemtl")
    of_name = [list(paints).index(name) if name in paints else -1 for name in painted.names]
    of = np.repeat(np.array([*of_name, -1])[painted.of], triangles.counts)
    if (of < 0).all():
        return None, notes
    from raytrace.image.texture import Texture

    uv, surfaces = file.of_corners("vt"), []
    for paint in paints.values():
        image = None if uv is None else paint.opacity_texture
        surfaces.append(AlphaSurface(paint.opacity, Texture(image) if image else None, grey=image != paint.texture))
    return Opacity(of, tuple(surfaces), None if uv is None else uv.rows[triangles.take(uv.of)]), notes
