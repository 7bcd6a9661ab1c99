"""glTF files made by hand, and a reader of what the specification demands of them, for the tests."""

import json
import struct
from functools import reduce
from operator import getitem

import numpy as np

COMPONENTS = {5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4")
QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="<f4")
HALVES = [[0, 1, 2], [0, 2, 3]]
"""The faces of `QUAD`."""


GONE = object()


def change(header, changes):
    """Put values, or what functions make of the header, at places such as nodes/0/mesh; `GONE` leaves nothing there."""
    for place, value in changes.items():
        *parts, last = (int(part) if part.isdecimal() else part for part in place.split("/"))
        holder = reduce(getitem, parts, header)
        if value is GONE:
            del holder[last]
        else:
            holder[last] = value(header) if callable(value) else value


class Builder:
    """A glTF document with one buffer."""

    def __init__(self):
        self.header = {"asset": {"version": "2.0"}, "scene": 0, "meshes": [], "accessors": [], "bufferViews": []}
        self.binary = b""

    def accessor(self, array, kind, **fields):
        component = next(code for code, dtype in COMPONENTS.items() if np.dtype(dtype) == array.dtype)
        self.header["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": array.nbytes})
        self.binary += array.tobytes() + b"\0" * (-array.nbytes % 4)
        self.header["accessors"].append(
            {
                "bufferView": len(self.header["bufferViews"]) - 1,
                "componentType": component,
                "count": len(array),
                "type": kind,
                **fields,
            }
        )
        return len(self.header["accessors"]) - 1

    def primitive(self, vertices, faces=None, normals=None, **fields):
        finite = np.isfinite(vertices).all() and len(vertices)
        bounds = {"min": vertices.min(axis=0).tolist(), "max": vertices.max(axis=0).tolist()} if finite else {}
        attributes = {"POSITION": self.accessor(vertices, "VEC3", **bounds)}
        if normals is not None:
            attributes["NORMAL"] = self.accessor(normals.astype("<f4"), "VEC3")
        made = {"attributes": attributes, **fields}
        if faces is not None:
            made["indices"] = self.accessor(np.asarray(faces, dtype="<u2").ravel(), "SCALAR")
        return made

    def mesh(self, *primitives, **fields):
        self.header["meshes"].append({"primitives": list(primitives), **fields})
        return len(self.header["meshes"]) - 1

    def gltf(self, nodes, roots=None, uri="m.bin", **fields):
        """The header of a .gltf whose one buffer is at `uri`."""
        roots = list(range(len(nodes))) if roots is None else roots
        header = self.header | {"nodes": nodes, "scenes": [{"nodes": roots}]}
        return header | {"buffers": [{"byteLength": len(self.binary)} | ({"uri": uri} if uri else {})]} | fields

    def glb(self, nodes, roots=None, **fields):
        content = json.dumps(self.gltf(nodes, roots, None, **fields)).encode()
        content += b" " * (-len(content) % 4)
        chunks = struct.pack("<I4s", len(content), b"JSON") + content
        chunks += struct.pack("<I4s", len(self.binary), b"BIN\0") + self.binary
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def check_glb(data):
    """Header and binary chunk of a GLB file, after checking container, buffer views and accessors."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    assert size % 4 == 0
    header = json.loads(data[20 : 20 + size])
    binary_size, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0"
    assert binary_size % 4 == 0
    binary = data[28 + size :]
    assert len(binary) == binary_size
    (buffer,) = header["buffers"]
    assert set(buffer) == {"byteLength"}
    assert binary_size - 4 < buffer["byteLength"] <= binary_size
    for view in header["bufferViews"]:
        assert view["buffer"] == 0
        assert view.get("byteOffset", 0) + view["byteLength"] <= buffer["byteLength"]
    primitives = [primitive for mesh in header["meshes"] for primitive in mesh["primitives"]]
    used = {number for primitive in primitives for number in primitive["attributes"].values()}
    for number, accessor in enumerate(header["accessors"]):
        if "bufferView" not in accessor:
            assert "sparse" in accessor or number not in used
            continue
        view = header["bufferViews"][accessor["bufferView"]]
        item = np.dtype(COMPONENTS[accessor["componentType"]]).itemsize
        start = accessor.get("byteOffset", 0)
        assert (start + view.get("byteOffset", 0)) % item == 0
        assert start + item * WIDTHS[accessor["type"]] * accessor["count"] <= view["byteLength"]
    for mesh in header["meshes"]:
        for primitive in mesh["primitives"]:
            counts = {header["accessors"][n]["count"] for n in primitive["attributes"].values()}
            assert len(counts) == 1
    return header, binary


def values(header, binary, number):
    """The array of an accessor."""
    accessor = header["accessors"][number]
    start = header["bufferViews"][accessor["bufferView"]].get("byteOffset", 0) + accessor.get("byteOffset", 0)
    width = WIDTHS[accessor["type"]]
    array = np.frombuffer(binary, COMPONENTS[accessor["componentType"]], accessor["count"] * width, start)
    return array if width == 1 else array.reshape(-1, width)
