"""`obscurance prune`: a mesh file without the faces that nothing outside sees."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from obscurance.raytrace import Mesh
from obscurance.raytrace.errors import OptionError, printable
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.mesh.weld import coincident, connected_components
from obscurance.raytrace.system.atomic import check_writable, write_bytes
from obscurance.raytrace.system.checks import check_outputs
from obscurance.raytrace.types import AnyInts, Bools, Int64s

from ..bake.console import warn
from ..bake.options import PrunedBy
from ..formats.gltf.vertices import check_vertices, visible_glb
from ..formats.load import load, parser_errors
from ..formats.ply.write import bare_ply
from ..formats.stl import stl
from ..formats.unsupported import unsupported_features
from ..show.progress import progress

if TYPE_CHECKING:
    from obscurance.ao.unseen import Unseen

    from ..asset.asset import Asset

_ENDINGS = ".glb", ".ply", ".obj", ".stl", ".off"
_LISTED = 8  # objects that are gone


def prune(
    source: Path, output: Path, quiet: bool, by: PrunedBy, keep_neighbours: int, up: str | None = None, **seen: Any
) -> str:
    """Write the mesh file without its unseen faces, a .glb with all else that it has; return a line about it.

    Args: by: what goes as a whole, if nothing of it is seen. keep_neighbours: how many rings of faces around seen
        ones stay. up: axis of the file, if another. seen: options of `ao.unseen_faces`.

    Raises: OptionError: of the output's ending, or nothing would be left. MeshError: the file cannot be read.
    """
    from obscurance.ao.unseen import unseen_faces

    ending = output.suffix.lower()
    if ending not in _ENDINGS:
        raise OptionError("output", "a name ending in " + ", ".join(_ENDINGS), output)
    if keep_neighbours < 0:
        raise OptionError("keep_neighbours", "a number of rings from 0 on", keep_neighbours)
    check_writable(output)
    mesh_file = load(source, output if ending == ".glb" else None, up=up)
    check_outputs({"--output": output}, mesh_file.files)
    warn([], [*mesh_file.notes, *_losses(mesh_file, output)])
    if ending == ".glb" and not mesh_file.is_scene:
        from ..formats.gltf.write import document

        mesh_file = load(source.with_suffix(".glb"), output, document(mesh_file, None)[0].encode())
    if ending == ".glb":
        check_vertices(mesh_file)
    with progress(quiet, "rays") as (advance,):
        unseen = unseen_faces(mesh_file.mesh, progress=advance, **seen)
    group, names = _groups(mesh_file, by)
    kept = ~unseen.faces
    if by != "faces":
        kept = (np.bincount(group, kept, len(names)) > 0)[group]
    if keep_neighbours:
        kept = _with_rings(mesh_file.mesh, kept, keep_neighbours)
    where = "above" if seen.get("above") else "outside"
    if not kept.any():
        raise OptionError("mesh", f"faces that something {where} sees", f"{source}, without any: is it a room?")
    if ending == ".glb":
        with parser_errors(source):
            content, face_count = visible_glb(mesh_file, kept)
    else:
        content = _visible_mesh(mesh_file.mesh, kept, output)
        face_count = int(np.count_nonzero(kept))
    write_bytes(output, content)
    text = f"{output}: {face_count:,} faces; {len(kept) - face_count:,} that nothing {where} sees are gone"
    return text + _gone_in_words(unseen, kept, group, names)


def _gone_in_words(unseen: Unseen, kept: Bools, group: AnyInts, names: Sequence[str]) -> str:
    """What is gone of each group, those first of which that is least sure; empty if nothing is.

    Args: kept: (m,), the faces that are not gone. group: (m,), of each face, in `names`.
    """
    if kept.all():
        return ""
    totals = np.bincount(group, minlength=len(names))
    gone = []
    for number in np.unique(group[~kept]).tolist():
        faces = ~kept & (group == number)
        count = np.count_nonzero(faces)
        part = f"{count:,} faces" if count == totals[number] else f"{count:,} of {totals[number]:,} faces"
        gone.append((unseen.share(faces), f"{names[number]} ({part}, {unseen.share(faces):.1g})"))
    gone.sort(reverse=True)
    listed = ", ".join(printable(line) for _, line in gone[:_LISTED])
    more = f" and {len(gone) - _LISTED:,} more, surer" if len(gone) > _LISTED else ""
    return f": {listed}{more}. Of what each looks at less than its share may be open, with 95 % confidence"


def _groups(source: Asset, by: PrunedBy) -> tuple[AnyInts, list[str]]:
    """The number (m,) of each face's object, or connected part, and their names; a part has its object's."""
    of, names = source.objects_of_faces
    if by != "parts":
        return of, names
    corners = _corners(source.mesh)
    of_corners: Int64s = connected_components(corners, int(corners.max()) + 1)
    _, first, part = np.unique(of_corners[corners[:, 0]], return_index=True, return_inverse=True)
    return part, [names[of[row]] for row in first]


def _corners(mesh: Mesh) -> Int64s:
    """The vertices (m, 3) of all faces, coincident ones as one."""
    numbers: Int64s = coincident(Placement.of(mesh).vertices, mesh.faces)[mesh.faces]
    return numbers


def _with_rings(mesh: Mesh, kept: Bools, rings: int) -> Bools:
    """The kept faces, and `rings` around them."""
    corners = _corners(mesh)
    for _ in range(rings):
        beside = np.zeros(int(corners.max()) + 1, np.bool_)
        beside[corners[kept]] = True
        kept = np.any(beside[corners], axis=1)
    return kept


def _losses(source: Asset, output: Path) -> Sequence[str]:
    """A line about what the file to be written leaves out, if that is anything."""
    if output.suffix.lower() == ".glb":
        return unsupported_features(output, source)
    if not (source.materials or source.unread or any(one.columns for one in source.primitives)):
        return ()
    return (f"{output}: not kept from {source.path}: all but vertices and triangles, which only a .glb keeps",)


def _visible_mesh(mesh: Mesh, seen: Bools, output: Path) -> bytes:
    """The seen faces and their vertices alone, all digits of these kept. Raises: OptionError: as `stl`."""
    used, corners = np.unique(mesh.faces[seen], return_inverse=True)
    vertices, faces = mesh.vertices[used], corners.reshape(-1, 3)
    ending = output.suffix.lower()
    if ending == ".ply":
        return bare_ply(Mesh(vertices, faces))
    if ending == ".stl":
        return stl(vertices, faces, output)
    coordinates = [" ".join(map(repr, row)) for row in vertices.tolist()]
    if ending == ".obj":
        lines = [f"v {row}" for row in coordinates] + ["f {} {} {}".format(*row) for row in (faces + 1).tolist()]
    else:
        head = "OFF", f"{len(vertices)} {len(faces)} 0"
        lines = [*head, *coordinates, *("3 {} {} {}".format(*row) for row in faces.tolist())]
    return "\n".join([*lines, ""]).encode()
