"""Objects of a mesh file by patterns of their names: which get w, which occlude, and which do neither."""

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from raytrace.errors import OptionError, nearest_name
from raytrace.mesh.mesh import Mesh
from raytrace.mesh.opacity import AlphaSurface, Opacity
from raytrace.types import Bools, Float64s

from .glb.pieces import pieces
from .load import MeshFile

_LISTED = 8  # names in a message


class Chosen(NamedTuple):
    """What is baked of a mesh file.

    Attributes:
        mesh: the file's, with as many vertices and faces; those of excluded objects have no area, those of objects
            that do not occlude alpha 0.
        receive: bool (m,), the faces of objects that get w.
    """

    mesh: Mesh
    receive: Bools

    @property
    def only(self) -> Bools | None:
        """bool (n,), the vertices that get w; None: all."""
        if self.receive.all():
            return None
        only = np.zeros(len(self.mesh.vertices), np.bool_)
        only[self.mesh.faces[self.receive]] = True
        return only

    def on_pages(self, uv: Float64s) -> Float64s:
        """Texture coordinates (m, 3, 2), NaN of faces that get no w."""
        return uv if self.receive.all() else np.where(self.receive[:, None, None], uv, np.nan)


def choose(
    source: MeshFile, receive: Sequence[str], cast: Sequence[str], exclude: Sequence[str], lenient: bool = False
) -> Chosen:
    """Choose objects by names or patterns of `fnmatch`, after a "!" those that do not match.

    Args:
        receive, cast: the objects that get w, and that occlude; none: all.
        exclude: objects that do neither. lenient: whether it may match nothing.

    Raises: OptionError: a pattern matches no object, or nothing is left to bake.
    """
    mesh, every = source.mesh, np.ones(len(source.mesh.faces), np.bool_)
    excluded = _named(source, "exclude", exclude, lenient) if exclude else ~every
    received = (_named(source, "receive", receive) if receive else every) & ~excluded
    if not received.any():
        name, given = ("receive", receive) if receive else ("exclude", exclude)
        raise OptionError(name, "patterns that leave an object to bake", " ".join(given), source.path)
    if excluded.any():
        point = mesh.faces[received][0, 0]
        mesh = replace(mesh, faces=np.where(excluded[:, None], point, mesh.faces))
    if cast:
        known = mesh.opacity or Opacity(np.full(len(mesh.faces), -1), ())
        of = np.where(_named(source, "cast", cast), known.of, len(known.surfaces))
        mesh = replace(mesh, opacity=replace(known, of=of, surfaces=(*known.surfaces, AlphaSurface(0.0))))
    return Chosen(mesh, received)


def _named(source: MeshFile, option: str, patterns: Sequence[str], lenient: bool = False) -> Bools:
    """The faces (m,) of objects that match any of the patterns."""
    found = np.zeros(len(source.mesh.faces), np.bool_)
    objects = [(piece.object.name, piece.faces) for piece in pieces(source)]
    for pattern in patterns:
        wanted = pattern.removeprefix("!")
        matches = {name for name, _ in objects if name == wanted or fnmatchcase(name, wanted)}
        if not matches and not lenient:
            names = list(dict.fromkeys(name for name, _ in objects))
            more = f" and {len(names) - _LISTED:,} more" if len(names) > _LISTED else ""
            expected = f"a name or pattern of its objects, {', '.join(names[:_LISTED])}{more}"
            raise OptionError(option, expected, repr(pattern), source.path, nearest_name(wanted, names))
        for name, faces in objects:
            if (name in matches) != (wanted != pattern):
                found[faces] = True
    return found
