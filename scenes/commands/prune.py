"""`obscurance prune`: a mesh file without the faces that nothing outside sees."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from raytrace.errors import OptionError
from raytrace.mesh.mesh import Mesh
from raytrace.system.atomic import check_writable, write_bytes
from raytrace.system.checks import check_outputs, check_regular
from raytrace.types import Bools

from ..formats.load import parser_errors

if TYPE_CHECKING:
    import trimesh

_ENDINGS = ".glb", ".ply", ".obj", ".stl", ".off"


def prune(source: Path, output: Path, seed: int, threads: int | None) -> str:
    """Write the mesh file without its unseen faces, with materials in a .glb; return a line about it.

    Raises: OptionError: of the output's ending, or nothing would be left. InputError: the file cannot be read.
    """
    import trimesh

    from ao.unseen import unseen_faces

    ending = output.suffix.lower()
    if ending not in _ENDINGS:
        raise OptionError("output", "a name ending in " + ", ".join(_ENDINGS), output)
    check_outputs({"--output": output}, [source])
    check_writable(output)
    check_regular(source, "a mesh file")
    with parser_errors(source):
        scene = trimesh.load_scene(source, process=False)
        nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
        placed = [(matrix, name) for matrix, name in nodes if isinstance(scene.geometry[name], trimesh.Trimesh)]
        mesh = _joined(scene, placed, str(source))
    found = unseen_faces(mesh, seed, threads)
    if found.faces.all():
        raise OptionError("mesh", "faces that something outside sees", f"{source}, without any: is it a room?")
    gone = _gone(scene, placed, found.faces)
    count = sum(int(np.count_nonzero(gone[name])) for _, name in placed)
    write_bytes(output, _without(scene, gone, ending))
    text = f"{output}: {len(mesh.faces) - count:,} faces; {count:,} that nothing outside sees are gone"
    return f"{text}. Of what one of these looks at less than {found.share:.2%} is open, with 95 % confidence"


def _joined(scene: trimesh.Scene, placed: list[tuple[Any, str]], source: str) -> Mesh:
    """All instances as one mesh, in their order."""
    vertices = [np.zeros((0, 3))]
    faces = [np.zeros((0, 3), np.int64)]
    count = 0
    for matrix, name in placed:
        geometry = scene.geometry[name]
        vertices.append(geometry.vertices @ matrix[:3, :3].T + matrix[:3, 3])
        faces.append(geometry.faces + count)
        count += len(geometry.vertices)
    return Mesh(np.concatenate(vertices), np.concatenate(faces), source=source)


def _gone(scene: trimesh.Scene, placed: list[tuple[Any, str]], unseen: Bools) -> dict[str, Bools]:
    """The faces of each geometry that are unseen in all of its instances."""
    hidden: dict[str, Bools] = {}
    start = 0
    for _, name in placed:
        stop = start + len(scene.geometry[name].faces)
        hidden[name] = hidden.get(name, np.True_) & unseen[start:stop]
        start = stop
    return hidden


def _without(scene: trimesh.Scene, gone: dict[str, Bools], ending: str) -> bytes:
    """The file without some faces of each geometry."""
    for name, faces in gone.items():
        if faces.all():
            scene.delete_geometry(name)
        elif faces.any():
            scene.geometry[name].update_faces(~faces)
            scene.geometry[name].remove_unreferenced_vertices()
    if ending == ".glb":
        content: bytes = scene.export(file_type="glb")
        return content
    more = {"include_texture": False} if ending == ".obj" else {}
    exported: bytes | str = scene.to_mesh().export(file_type=ending[1:], **more)
    return exported.encode() if isinstance(exported, str) else exported
