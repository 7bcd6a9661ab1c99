"""`obscurance prune`: a mesh file without the faces that nothing outside sees."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from obscurance.raytrace import Mesh
from obscurance.raytrace.errors import OptionError, printable
from obscurance.raytrace.mesh.normals import face_normals
from obscurance.raytrace.mesh.placement import Placement
from obscurance.raytrace.mesh.weld import coincident, connected_components
from obscurance.raytrace.system.atomic import check_writable, write_bytes
from obscurance.raytrace.system.checks import check_outputs
from obscurance.raytrace.types import AnyInts, Bools, Float64s, Int64s

from ..bake.console import warn
from ..bake.options import PrunedBy
from ..formats.gltf.vertices import check_vertices
from ..formats.load import load, parser_errors
from ..formats.ply.write import bare_ply
from ..formats.stl import TRIANGLE
from ..formats.unsupported import unsupported_features
from ..show.progress import progress

if TYPE_CHECKING:
    from ..asset.asset import Asset, Part
    from ..formats.gltf.asset import Gltf
    from ..formats.gltf.builder import GlbBuilder

_ENDINGS = ".glb", ".ply", ".obj", ".stl", ".off"
_LISTED = 8  # objects that are gone
_ROUNDED = 1e-6  # of a mesh's extent, by which a vertex may move in an .stl
_ZERO = {"componentType": 5121, "count": 1, "type": "SCALAR"}  # an accessor of a zero takes no bytes


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
            content, face_count = _visible_glb(mesh_file, kept)
    else:
        content = _visible_mesh(mesh_file.mesh, kept, output)
        face_count = int(np.count_nonzero(kept))
    write_bytes(output, content)
    text = f"{output}: {face_count:,} faces; {len(kept) - face_count:,} that nothing {where} sees are gone"
    # What is gone of each group, those first of which that is least sure.
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
    sure = f": {listed}{more}. Of what each looks at less than its share may be open, with 95 % confidence"
    return text + (sure if gone else "")


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
    """The seen faces and their vertices alone, all digits of these kept. Raises: OptionError: as `_stl`."""
    used, corners = np.unique(mesh.faces[seen], return_inverse=True)
    vertices, faces = mesh.vertices[used], corners.reshape(-1, 3)
    ending = output.suffix.lower()
    if ending == ".ply":
        return bare_ply(Mesh(vertices, faces))
    if ending == ".stl":
        return _stl(vertices, faces, output)
    coordinates = [" ".join(map(repr, row)) for row in vertices.tolist()]
    if ending == ".obj":
        lines = [f"v {row}" for row in coordinates] + ["f {} {} {}".format(*row) for row in (faces + 1).tolist()]
    else:
        head = "OFF", f"{len(vertices)} {len(faces)} 0"
        lines = [*head, *coordinates, *("3 {} {} {}".format(*row) for row in faces.tolist())]
    return "\n".join([*lines, ""]).encode()


def _stl(vertices: Float64s, faces: AnyInts, output: Path) -> bytes:
    """A binary STL. Raises: OptionError: float32, which it has, moves vertices by a millionth of their extent."""
    with np.errstate(over="ignore"):
        rounded = vertices.astype("<f4")
    moved = np.abs(rounded - vertices).max()
    if moved > _ROUNDED * np.ptp(vertices, axis=0).max():
        raise OptionError(
            "output", "a .ply, .obj or .off, for .stl has float32", f"{output}: vertices move by {moved:.3g}"
        )
    table = np.zeros(len(faces), TRIANGLE)
    table["normal"] = face_normals(vertices, faces)[0]
    table["vertices"] = rounded[faces]
    return bytes(80) + len(faces).to_bytes(4, "little") + table.tobytes()


def _visible_glb(source: Asset, seen: Bools) -> tuple[bytes, int]:
    """The document without unseen faces, and how many faces it draws.

    An instance goes if all of its faces are unseen; a face that instances share, if it is unseen in all of them.
    """
    from ..formats.gltf.accessors import triangles
    from ..formats.gltf.asset import Gltf
    from ..formats.gltf.vertices import draw, take_vertices
    from ..formats.gltf.write import one_buffer

    asset = source.raw
    assert isinstance(asset, Gltf)
    builder = one_buffer(asset)
    meshes = builder.header["meshes"]
    showing = _visible_nodes(asset, source.parts, seen)
    kept_faces = _visible_faces(asset, source.parts, seen)
    # Nodes of which nothing is seen draw nothing any more.
    for number in {drawn.node for drawn in asset.drawn} - showing:
        for field in ("mesh", "skin", "weights"):
            builder.header["nodes"][number].pop(field, None)
    # Each primitive with its faces that are kept, and their vertices.
    before = _values_of_primitives(meshes)
    primitives = {(drawn.mesh, drawn.primitive_number): drawn.primitive for drawn in asset.drawn}
    for (mesh, number), primitive in primitives.items():
        faces_kept = kept_faces[mesh, number]
        stored = meshes[mesh]["primitives"][number]
        if faces_kept.any():
            count = asset.geometry.accessors[primitive.attributes["POSITION"]].count
            faces = triangles(asset, primitive, count)[faces_kept]
            used, corners = np.unique(faces, return_inverse=True)
            take_vertices(builder, asset, stored, used)
            draw(builder, stored, corners)
        else:
            meshes[mesh]["primitives"][number] = None
    _drop_empty_meshes(builder.header)
    _drop_values(builder, before - _values_of_primitives(builder.header["meshes"]))
    drawn_faces = [kept_faces[drawn.mesh, drawn.primitive_number] for drawn in asset.drawn if drawn.node in showing]
    return builder.encode(), sum(int(np.count_nonzero(faces)) for faces in drawn_faces)


def _visible_nodes(asset: Gltf, parts: Sequence[Part], seen: Bools) -> set[int]:
    """The nodes that show something: seen faces, lines or points."""
    numbers = Counter(mesh for mesh, _ in {(drawn.mesh, drawn.primitive_number) for drawn in asset.drawn})
    with_lines = {mesh for mesh, count in numbers.items() if count < len(asset.geometry.meshes[mesh].primitives)}
    instances = zip(asset.drawn, parts, strict=True)
    return {drawn.node for drawn, part in instances if drawn.mesh in with_lines or seen[part.faces].any()}


def _visible_faces(asset: Gltf, parts: Sequence[Part], seen: Bools) -> dict[tuple[int, int], Bools]:
    """The faces of each mesh and primitive that are seen in some instance; all of a mesh that another scene shows,
    too."""
    drawn_nodes = {drawn.node for drawn in asset.drawn}
    elsewhere = {node.mesh for number, node in enumerate(asset.geometry.nodes) if number not in drawn_nodes}
    seen_faces: dict[tuple[int, int], Bools] = {}
    for drawn, part in zip(asset.drawn, parts, strict=True):
        primitive = drawn.mesh, drawn.primitive_number
        seen_faces[primitive] = seen[part.faces] | seen_faces.get(primitive, np.bool_(drawn.mesh in elsewhere))
    return seen_faces


def _values_of_primitives(meshes: list[dict[str, Any]]) -> set[int]:
    """The accessors of all primitives."""
    primitives = [primitive for mesh in meshes for primitive in mesh["primitives"]]
    tables = [table for primitive in primitives for table in (primitive["attributes"], *primitive.get("targets", []))]
    used = {number for table in tables for number in table.values()}
    return used | {primitive["indices"] for primitive in primitives if "indices" in primitive}


def _drop_empty_meshes(header: dict[str, Any]) -> None:
    """Take primitives that are None out of their meshes, and meshes without primitives out of the document."""
    for mesh in header["meshes"]:
        mesh["primitives"] = [primitive for primitive in mesh["primitives"] if primitive]
    drawn_meshes = [number for number, mesh in enumerate(header["meshes"]) if mesh["primitives"]]
    header["meshes"] = [header["meshes"][number] for number in drawn_meshes]
    for node in header["nodes"]:
        if "mesh" in node:
            node["mesh"] = drawn_meshes.index(node["mesh"])


def _drop_values(builder: GlbBuilder, unused: set[int]) -> None:
    """Replace accessors that are `unused`, which keep their numbers, by zeros, and drop what no view shows from the
    buffer."""
    header = builder.header
    for number in unused:
        header["accessors"][number] = dict(_ZERO)
    used = set(_buffer_views(header))
    stored = bytes(builder.binary)
    builder.binary.clear()
    for number, view in enumerate(header["bufferViews"]):
        start = view["byteOffset"]
        if number not in used:
            view["byteLength"] = 1
            view.pop("byteStride", None)
        view["byteOffset"] = builder.add(stored[start : start + view["byteLength"]])


def _buffer_views(value: Any) -> Iterator[int]:
    """Numbers of all buffer views that a document refers to."""
    if isinstance(value, dict):
        if isinstance(value.get("bufferView"), int):
            yield value["bufferView"]
        value = value.values()
    elif not isinstance(value, list):
        return
    for child in value:
        yield from _buffer_views(child)
