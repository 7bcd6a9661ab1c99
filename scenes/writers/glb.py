"""Obscurance as vertex attributes of a binary glTF file."""

from __future__ import annotations

import copy
from functools import cache
from pathlib import Path

from raytrace.types import AnyFloats

from ..geometry.instances import Part
from ..gltf.container import Gltf, encode_glb, primitives, referenced
from ..gltf.glb_buffer import Packed
from ..readers.load import MeshFile
from .plain_glb import plain


def glb(mesh_file: MeshFile, w: AnyFloats, colors: bool) -> bytes:
    """A GLB file with the vertex attribute `_OBSCURANCE` (float32 SCALAR), and `COLOR_0` = w if `colors`.

    A glTF source is kept as stored, with all its nodes, materials, textures, animations and extensions; only the
    attributes are added, and meshes that several nodes share are given to each node separately, because each
    instance has its own w. Every other source becomes one node a part, in world space, with the normals, texture
    coordinates, colours and materials that it has (`plain_glb.plain`).

    Args:
        mesh_file: what was baked.
        w: (n,), per vertex of `mesh_file.mesh`.
        colors: also write w, linear as glTF's vertex colours are, to `COLOR_0`. An existing one is replaced.

    Raises:
        OptionError: coordinates of a source that is no glTF are too large for float32.
    """
    asset = mesh_file.gltf
    packed = _annotate(asset, mesh_file.parts, w, colors) if asset else plain(mesh_file, w, colors)
    packed.header["buffers"] = [{"byteLength": len(packed.binary)}]
    return encode_glb(packed.header, bytes(packed.binary))


def _annotate(asset: Gltf, parts: tuple[Part, ...], w: AnyFloats, colors: bool) -> Packed:
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


def _one_buffer(asset: Gltf) -> Packed:
    """The asset with all buffers joined, and with the images beside it taken in where they can be read."""
    packed = Packed(copy.deepcopy(asset.header))
    offsets = [packed.add(buffer) for buffer in asset.buffers]
    for view in packed.header.get("bufferViews", []):
        view["byteOffset"] = view.get("byteOffset", 0) + offsets[view["buffer"]]
        view["buffer"] = 0
    read = cache(Path.read_bytes)
    views: dict[int, int] = {}
    for image in packed.header.get("images", []):
        uri = str(image.get("uri", "data:"))
        data = None if uri.startswith("data:") else referenced(uri, asset.path.parent, read)
        if data is not None:
            del image["uri"]
            image.setdefault("mimeType", "image/png" if data.startswith(b"\x89PNG") else "image/jpeg")
            if id(data) not in views:
                views[id(data)] = packed.bytes_view(data)
            image["bufferView"] = views[id(data)]
    return packed
