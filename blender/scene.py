"""The meshes of a Blender scene as glTF files: those to be baked, and what else occludes."""

import json
import struct
from typing import NamedTuple

import bpy
import numpy as np

from .job import BakeFailed

_SURFACES = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


class Corners(NamedTuple):
    """A mesh in the world, a vertex for each corner of its faces."""

    positions: np.ndarray  # float32 (c, 3)
    normals: np.ndarray  # float32 (c, 3)
    triangles: np.ndarray  # uint32 (t, 3)
    uv: np.ndarray | None  # float32 (c, 2), v upwards


class Source(NamedTuple):
    """An object that gets w: its name in the files, and the rows of its corners in the result."""

    thing: bpy.types.Object
    name: str
    rows: slice


class Sources(NamedTuple):
    """The objects that get w, and the files."""

    baked: list[Source]
    mesh: bytes
    occluder: bytes | None


def collect(context, others, needs_uv):
    """The selected objects as they are shown, and all others that are visible. Raises: BakeFailed.

    Args: others: whether these occlude. needs_uv: whether texture coordinates are needed.
    """
    graph = context.evaluated_depsgraph_get()
    selected = {thing for thing in context.selected_objects if thing.type == "MESH"}
    baked, occluding = {}, []
    for instance in graph.object_instances:
        thing = instance.object
        if not instance.show_self or thing.type not in _SURFACES:
            continue
        is_baked = not instance.is_instance and thing.original in selected
        if is_baked or others:
            corners = _corners(thing, np.array(instance.matrix_world))
            if is_baked:
                baked[thing.original] = corners
            elif len(corners.triangles):
                occluding.append(corners)
    sources, begin = [], 0
    for thing, corners in baked.items():
        if not len(corners.triangles):
            raise BakeFailed(f"{thing.name}: expected faces, got none")
        if needs_uv and corners.uv is None:
            raise BakeFailed(f"{thing.name}: expected a UV map, got none")
        if not needs_uv and len(corners.positions) != len(thing.data.loops):
            raise BakeFailed(f"{thing.name}: its modifiers change its faces: apply them, or bake into an image")
        rows = slice(begin, begin + len(corners.positions))
        sources.append(Source(thing, f"object{len(sources)}", rows))
        begin = rows.stop
    if not sources:
        raise BakeFailed("expected visible meshes among the selected objects, got none")
    meshes = {source.name: baked[source.thing] for source in sources}
    walls = {f"occluder{number}": corners._replace(uv=None) for number, corners in enumerate(occluding)}
    return Sources(sources, _glb(meshes), _glb(walls) if walls else None)


def _corners(thing, matrix):
    """The corners of an evaluated object, placed by a matrix (4, 4)."""
    mesh = thing.to_mesh()
    if mesh is None:
        empty = np.zeros((0, 3), np.float32)
        return Corners(empty, empty, np.zeros((0, 3), np.uint32), None)
    mesh.calc_loop_triangles()
    positions = _read(mesh.vertices, "co", 3)[_read(mesh.loops, "vertex_index", 1, np.int32).ravel()]
    normals = _read(mesh.corner_normals, "vector", 3)
    triangles = _read(mesh.loop_triangles, "loops", 3, np.int32).astype(np.uint32)
    layer = mesh.uv_layers.active
    uv = _read(layer.uv, "vector", 2) if layer else None
    thing.to_mesh_clear()
    turn = matrix[:3, :3]
    if np.linalg.det(turn) < 0:
        triangles = triangles[:, ::-1]
    placed = (positions @ turn.T + matrix[:3, 3]).astype(np.float32)
    if not np.isfinite(placed).all():
        raise BakeFailed(f"{thing.name}: expected finite coordinates, got others")
    cofactors = np.stack([np.cross(turn[1], turn[2]), np.cross(turn[2], turn[0]), np.cross(turn[0], turn[1])])
    turned = normals @ cofactors.T * np.sign(np.linalg.det(turn) or 1.0)
    turned /= np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-30)
    return Corners(placed, turned.astype(np.float32), triangles, uv)


def _read(collection, name, width, kind=np.float32):
    """An attribute of all elements of a collection (k, width)."""
    values = np.empty(len(collection) * width, kind)
    collection.foreach_get(name, values)
    return values.reshape(-1, width)


def _glb(meshes):
    """A GLB file of meshes by their names, a node for each (Khronos glTF 2.0, chapters 3 and 4)."""
    data, views, accessors, primitives = bytearray(), [], [], []

    def accessor(values, target, **fields):
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}[values.shape[1]]
        view = {"buffer": 0, "byteOffset": len(data), "byteLength": values.nbytes, "target": target}
        views.append(view)
        data.extend(values.tobytes())
        component = 5125 if values.dtype == np.uint32 else 5126
        entry = {"bufferView": len(views) - 1, "componentType": component, "count": len(values), "type": kind}
        accessors.append(entry | fields)
        return len(accessors) - 1

    for corners in meshes.values():
        low, high = corners.positions.min(axis=0).tolist(), corners.positions.max(axis=0).tolist()
        attributes = {
            "POSITION": accessor(corners.positions, 34962, min=low, max=high),
            "NORMAL": accessor(corners.normals, 34962),
        }
        if corners.uv is not None:
            attributes["TEXCOORD_0"] = accessor((corners.uv * (1, -1) + (0, 1)).astype(np.float32), 34962)
        indices = accessor(corners.triangles.reshape(-1, 1), 34963)
        primitives.append({"attributes": attributes, "indices": indices})
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "nodes": [{"name": name, "mesh": number} for number, name in enumerate(meshes)],
        "meshes": [{"primitives": [primitive]} for primitive in primitives],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    header = json.dumps(document).encode()
    header += b" " * (-len(header) % 4)
    chunks = struct.pack("<II", len(header), 0x4E4F534A) + header + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks
