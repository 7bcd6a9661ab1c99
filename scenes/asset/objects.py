"""Objects of mesh files by names: which get w, which occlude, do neither, or each alone, and which are matched."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from obscurance.raytrace.errors import ConflictError, OptionError, check_type, first_names, nearest_name
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.raytrace.mesh.opacity import AlphaSurface, Opacity
from obscurance.raytrace.types import Bools, Float64s, Int64s

if TYPE_CHECKING:
    from obscurance.ao.falloff import Falloff

    from .asset import Asset

_LISTED = 8  # names in a message


class ObjectSelection(NamedTuple):
    """The part of a mesh file that is baked."""

    mesh: Mesh  # with as many faces; those of excluded objects have no area, those that do not occlude alpha 0
    receive: Bools  # (m,), the faces of objects that get w
    group: Int64s | None = None  # (m,), only faces of the same number occlude each other; None: all do

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

    def of_page(self, uv: Float64s) -> Mesh:
        """The mesh that occludes the faces on a page: where groups are baked, only their group keeps its area.

        Raises: ConflictError: faces of several groups are on the page.
        """
        from obscurance.ao.texture.uv_layout import on_page

        shown = on_page(uv)
        if self.group is None or not shown.any():
            return self.mesh
        number, *more = np.unique(self.group[shown])
        if more:
            raise ConflictError("occluded_by", "needs", "<OBJECT> in the name of an image: its textures have several")
        return _without(self.mesh, self.group != number)

    def absolute(self, falloff: Falloff) -> Falloff:
        """The falloff in mesh units where groups are baked, so that per cent stay those of the radius of all."""
        mu = falloff.resolve(self.mesh.radius)
        if self.group is None or mu.form == "table":
            return falloff
        lengths: dict[str, Any] = {"max_distance": mu.max_distance}
        if mu.form == "exponential":
            lengths |= {"tau": mu.tau, "half_distance": None}
        return replace(falloff, **lengths)

    def parts(self) -> Iterator[tuple[Int64s, Int64s, Mesh]]:
        """The groups of which some face gets w: their vertices in the mesh (k,), their faces (m,), and the group as a
        mesh of its own."""
        mesh = self.mesh
        group = np.zeros(len(self.receive), np.int64) if self.group is None else self.group
        order = np.argsort(group, kind="stable")
        for face_rows in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
            if self.receive[face_rows].any():
                vertices, corners = np.unique(mesh.faces[face_rows], return_inverse=True)
                normals = None if mesh.normals is None else mesh.normals[vertices]
                of_corners = mesh.corner_normals
                facts: dict[str, Any] = {
                    "opacity": mesh.opacity and mesh.opacity.only(face_rows),
                    "polygons": None if mesh.polygons is None else mesh.polygons[face_rows],
                    "corner_normals": of_corners and of_corners._replace(of=of_corners.of[face_rows]),
                }
                triangles = corners.reshape(-1, 3)
                yield (
                    vertices.astype(np.int64),
                    face_rows,
                    Mesh(mesh.vertices[vertices], triangles, normals, source=mesh.source, up=mesh.up, **facts),
                )


def select_objects(
    source: Asset,
    receive: Sequence[str] = (),
    cast: Sequence[str] = (),
    exclude: Sequence[str] = (),
    by: str = "all",
    lenient: bool = False,
) -> ObjectSelection:
    """Choose objects by names or patterns of `fnmatch`, after a "!" those that do not match.

    Args:
        receive, cast: the objects that get w, and that occlude; none: all.
        exclude: objects that do neither. lenient: whether it may match nothing.
        by: whether faces are occluded by all, by their own object, or by objects of its name.

    Raises: OptionError: a pattern matches no object, or nothing is left to bake.
    """
    for name, patterns in (("receive", receive), ("cast", cast), ("exclude", exclude)):
        check_type(patterns, (list, tuple), "options", name, "a list of names or patterns")
    if by not in ("all", "object", "name"):
        raise OptionError("by", "all, object or name", repr(by))
    mesh = source.mesh
    excluded = _named(source, "exclude", exclude, lenient) if exclude else np.zeros(1, np.bool_)
    received = np.broadcast_to(~excluded, len(mesh.faces))
    if receive:
        received = _named(source, "receive", receive) & received
    if not received.any():
        name = "receive" if receive else "exclude"
        raise OptionError(name, "patterns that leave an object to bake", " ".join(receive or exclude), source.path)
    if excluded.any():
        mesh = _without(mesh, excluded)
    if cast:
        opacity = mesh.opacity or Opacity(np.full(len(mesh.faces), -1), ())
        of = np.where(_named(source, "cast", cast), opacity.of, len(opacity.surfaces))
        mesh = replace(mesh, opacity=replace(opacity, of=of, surfaces=(*opacity.surfaces, AlphaSurface(0.0))))
    if by == "all":
        return ObjectSelection(mesh, received)
    group = np.zeros(len(mesh.faces), np.int64)
    numbers = dict[Hashable, int]()
    for run in source.runs():
        group[run.faces] = numbers.setdefault(getattr(run.object, "name" if by == "name" else "key"), len(numbers))
    return ObjectSelection(mesh, received, group)


def _without(mesh: Mesh, faces: Bools) -> Mesh:
    """The mesh with some faces, bool (m,), without an area."""
    return replace(mesh, faces=np.where(faces[:, None], mesh.faces[~faces][0, 0], mesh.faces))


def match(low: Asset, high: Sequence[Asset]) -> tuple[Int64s, Int64s]:
    """Groups of vertices (n,) of a coarse file and of fine ones, by objects' names as far as "_low" and "_high".

    Raises: OptionError: an object of `low` has no fine one.
    """
    numbers: dict[str, int] = {}
    object_numbers = []
    for file, suffix in ((low, "_low"), *((high_file, "_high") for high_file in high)):
        of = np.full(len(file.mesh.vertices), -1)
        for run in file.runs():
            of[file.mesh.faces[run.faces]] = numbers.setdefault(run.object.name.partition(suffix)[0], len(numbers))
        object_numbers.append(of)
    of_low = object_numbers[0]
    of_high = np.concatenate(object_numbers[1:])
    lacking = np.setdiff1d(of_low[of_low >= 0], of_high)
    if len(lacking):
        names = ", ".join([f"{name}_high" for name, number in numbers.items() if number in lacking][:_LISTED])
        raise OptionError("match_names", "an object of --high for each of the input", f"no {names}", low.path)
    return of_low, of_high


def _named(source: Asset, option: str, patterns: Sequence[str], lenient: bool = False) -> Bools:
    """The faces (m,) of objects that match any of the patterns."""
    is_named = np.zeros(len(source.mesh.faces), np.bool_)
    objects = [(run.object.name, run.faces) for run in source.runs()]
    for pattern in patterns:
        wanted = pattern.removeprefix("!")
        matches = {name for name, _ in objects if name == wanted or fnmatchcase(name, wanted)}
        if not matches and not lenient:
            names = list(dict.fromkeys(name for name, _ in objects))
            expected = f"a name or pattern of its objects, {first_names(names, _LISTED)}"
            raise OptionError(option, expected, repr(pattern), source.path, nearest_name(wanted, names))
        for name, faces in objects:
            if (name in matches) != (wanted != pattern):
                is_named[faces] = True
    return is_named
