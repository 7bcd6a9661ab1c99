"""Obscurance as vertex attributes of a binary glTF file."""

from __future__ import annotations

import copy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from raytrace.errors import OptionError
from raytrace.mesh import Mesh

from .flatten import Part
from .gltf import Gltf, encode_glb, primitives, reference
from .load import MeshFile

_FLOAT, _UNSIGNED_BYTE, _UNSIGNED_INT = 5126, 5121, 5125
_LARGEST = 1e38  # of float32, and of a difference of two
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963


def glb(mesh_file: MeshFile, w: npt.NDArray[np.floating[Any]], colors: bool) -> bytes:
    """A GLB file with the vertex attribute `_OBSCURANCE` (float32 SCALAR), and `COLOR_0` = w if `colors`.

    A glTF source is kept as stored, with all its nodes, materials, textures, animations and extensions; only the
    attributes are added, and meshes that several nodes share are given to each node separately, because each
    instance has its own w. Every other source becomes one node a part, in world space and of a plain white material.

    Args:
        mesh_file: what was baked.
        w: (n,), per vertex of `mesh_file.mesh`.
        colors: also write w, linear as glTF's vertex colours are, to `COLOR_0`. An existing one is replaced.

    Raises:
        OptionError: coordinates of a source that is no glTF are too large for float32.
    """
    asset = mesh_file.gltf
    packed = _annotate(asset, mesh_file.parts, w, colors) if asset else _plain(mesh_file, w, colors)
    packed.header["buffers"] = [{"byteLength": len(packed.binary)}]
    return encode_glb(packed.header, bytes(packed.binary))


class _Packed:
    """A glTF header and its one buffer, which grow together."""

    def __init__(self, header: dict[str, Any]) -> None:
        self.header = header
        self.binary = bytearray()

    def bytes_view(self, data: bytes, **fields: Any) -> int:
        """Index of a new buffer view of `data`."""
        views = self.header.setdefault("bufferViews", [])
        views.append({"buffer": 0, "byteOffset": self.add(data), "byteLength": len(data), **fields})
        return len(views) - 1

    def accessor(
        self, array: npt.NDArray[Any], component: int, kind: str, target: int = _ARRAY_BUFFER, **fields: Any
    ) -> int:
        """Index of a new accessor of `array`, rows of `kind`."""
        view = self.bytes_view(array.tobytes(), target=target)
        accessors = self.header.setdefault("accessors", [])
        accessors.append({"bufferView": view, "componentType": component, "count": len(array), "type": kind, **fields})
        return len(accessors) - 1

    def add(self, data: bytes) -> int:
        """Offset of `data` in the buffer, aligned as every component type needs."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        offset = len(self.binary)
        self.binary += data
        return offset

    def obscurance(self, w: npt.NDArray[np.floating[Any]], colors: bool) -> dict[str, int]:
        """Attributes of one primitive's vertices."""
        attributes = {"_OBSCURANCE": self.accessor(w.astype("<f4"), _FLOAT, "SCALAR")}
        if colors:
            grey = np.full((len(w), 4), 255, dtype=np.uint8)
            grey[:, :3] = np.rint(np.clip(w, 0, 1) * 255)[:, None]
            attributes["COLOR_0"] = self.accessor(grey, _UNSIGNED_BYTE, "VEC4", normalized=True)
        return attributes


def _annotate(asset: Gltf, parts: tuple[Part, ...], w: npt.NDArray[np.floating[Any]], colors: bool) -> _Packed:
    packed = _one_buffer(asset)
    nodes, meshes = packed.header["nodes"], packed.header["meshes"]
    originals = copy.deepcopy(meshes)
    owner: dict[int, int] = {}
    for piece, part in zip(primitives(asset.header), parts, strict=True):
        if owner.setdefault(piece.mesh, piece.node) != piece.node and nodes[piece.node]["mesh"] == piece.mesh:
            meshes.append(copy.deepcopy(originals[piece.mesh]))
            nodes[piece.node]["mesh"] = len(meshes) - 1
        primitive = meshes[nodes[piece.node]["mesh"]]["primitives"][piece.place]
        primitive["attributes"].update(packed.obscurance(w[part.vertices], colors))
    return packed


def _one_buffer(asset: Gltf) -> _Packed:
    """The asset with all buffers joined, and with the images beside it taken in where they can be read."""
    packed = _Packed(copy.deepcopy(asset.header))
    offsets = [packed.add(buffer) for buffer in asset.buffers]
    for view in packed.header.get("bufferViews", []):
        view["byteOffset"] = view.get("byteOffset", 0) + offsets[view["buffer"]]
        view["buffer"] = 0
    read = cache(Path.read_bytes)
    views: dict[int, int] = {}
    for image in packed.header.get("images", []):
        uri = str(image.get("uri", "data:"))
        data = None if uri.startswith("data:") else reference(uri, asset.path.parent, read)
        if data is not None:
            del image["uri"]
            image.setdefault("mimeType", "image/png" if data.startswith(b"\x89PNG") else "image/jpeg")
            if id(data) not in views:
                views[id(data)] = packed.bytes_view(data)
            image["bufferView"] = views[id(data)]
    return packed


def _plain(mesh_file: MeshFile, w: npt.NDArray[np.floating[Any]], colors: bool) -> _Packed:
    packed = _Packed(
        {
            "asset": {"version": "2.0", "generator": "obscurance"},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(mesh_file.parts)))}],
            "nodes": [],
            "meshes": [],
            "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}}],
        }
    )
    for number, part in enumerate(mesh_file.parts):
        node: dict[str, Any] = {"name": part.name, "mesh": number}
        attributes, indices, origin = _geometry(packed, mesh_file.mesh, part)
        if origin is not None:
            node["translation"] = origin.tolist()
        attributes |= packed.obscurance(w[part.vertices], colors)
        packed.header["nodes"].append(node)
        packed.header["meshes"].append(
            {"name": part.name, "primitives": [{"attributes": attributes, "indices": indices, "material": 0}]}
        )
    return packed


def _geometry(packed: _Packed, mesh: Mesh, part: Part) -> tuple[dict[str, int], int, npt.NDArray[np.float64] | None]:
    """Attributes, indices, and the origin of positions that float32 cannot hold about zero."""
    vertices = mesh.vertices[part.vertices]
    origin = None
    if np.abs(vertices).max() > _LARGEST:
        raise OptionError("output", f"coordinates up to {_LARGEST:g} in a .glb", f"{np.abs(vertices).max():g}")
    if not np.array_equal(vertices.astype("<f4"), vertices):
        origin = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        vertices = vertices - origin
    stored = vertices.astype("<f4")
    bounds = {"min": stored.min(axis=0).tolist(), "max": stored.max(axis=0).tolist()}
    attributes = {"POSITION": packed.accessor(stored, _FLOAT, "VEC3", **bounds)}
    if mesh.normals is not None:
        normals = mesh.normals[part.vertices]
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        # glTF allows unit normals only: a part that lacks some goes without.
        if np.isfinite(length).all() and (length > 0).all():
            attributes["NORMAL"] = packed.accessor((normals / length).astype("<f4"), _FLOAT, "VEC3")
    faces = (mesh.faces[part.faces] - part.vertices.start).astype("<u4").ravel()
    return attributes, packed.accessor(faces, _UNSIGNED_INT, "SCALAR", _ELEMENT_ARRAY_BUFFER), origin
