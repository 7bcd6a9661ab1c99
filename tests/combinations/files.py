"""Patches as mesh files, written here, and where each vertex, face and texel of them lies."""

import json
import struct
from dataclasses import dataclass, field

import numpy as np


@dataclass(eq=False)
class Model:
    """What a file holds.

    Attributes:
        vertices (n, 3), normals (n, 3) or None, uv (n, 2) or None. polygons: lists of vertices, of one object after
        the other. names: of the polygons' objects. patch: number (n,) of a vertex's patch, −1 where it lies on several
        that are not in one plane. place: (n, 2), where on it. face_patch, face_places: of the triangles that polygons
        are cut into, (m,) and (m, 3, 2).
    """

    vertices: list = field(default_factory=list)
    normals: list = field(default_factory=list)
    uv: list = field(default_factory=list)
    polygons: list = field(default_factory=list)
    names: list = field(default_factory=list)
    patch: list = field(default_factory=list)
    place: list = field(default_factory=list)
    face_patch: list = field(default_factory=list)
    face_places: list = field(default_factory=list)


def model(patches, rng, shared=False, loose=False, quads=False, charts=None, flipped=False):
    """Args: shared: vertices of an object at one place are one. loose: no two faces share any. quads: not cut in two.
    charts: (left, bottom, right, top) of each patch on the page. flipped: faces run the other way round."""
    made, known = Model(), {}
    turned = rng.random(len(patches)) < 0.5
    for number, part in enumerate(patches):
        across, along = part.cells

        def vertex(s, t, number=number, part=part):
            at, place = part.at(np.array(s), np.array(t)), (s, t)
            key = (part.name, *np.round(at, 9)) if shared else None if loose else (number, s, t)
            if key is not None and key in known:
                same = known[key]
                if made.patch[same] != number and not np.allclose(made.normals[same], part.normal, atol=1e-9):
                    made.patch[same] = -1
                return same
            if key is not None:
                known[key] = len(made.vertices)
            made.vertices.append(at)
            made.normals.append(part.normal)
            if charts is not None:
                left, bottom, right, top = charts[number]
                made.uv.append((left + s * (right - left), bottom + t * (top - bottom)))
            made.patch.append(number)
            made.place.append(place)
            return len(made.vertices) - 1

        for i in range(across):
            for j in range(along):
                corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                corners = [(x / across, y / along) for x, y in corners]
                if turned[number] and not quads:
                    corners = corners[1:] + corners[:1]
                cut = [corners] if quads else [corners[:3], [corners[0], *corners[2:]]]
                for polygon in cut:
                    made.polygons.append([vertex(*corner) for corner in (polygon[::-1] if flipped else polygon)])
                    made.names.append(part.name)
                for triangle in (corners[:3], [corners[0], *corners[2:]]):
                    made.face_patch.append(number)
                    made.face_places.append(triangle)
    return made


def ply(made, ascii_file, double, with_normals):
    kind, code = ("double", "f8") if double else ("float", "f4")
    names = ["x", "y", "z", *(["nx", "ny", "nz"] if with_normals else []), *(["s", "t"] if made.uv else [])]
    columns = [made.vertices, *([made.normals] if with_normals else []), *([made.uv] if made.uv else [])]
    rows = np.concatenate([np.array(column, float) for column in columns], axis=1)
    head = ["ply", f"format {'ascii' if ascii_file else 'binary_little_endian'} 1.0", f"element vertex {len(rows)}"]
    head += [f"property {kind} {name}" for name in names]
    head += [f"element face {len(made.polygons)}", "property list uchar int vertex_indices", "end_header\n"]
    content = "\n".join(head).encode()
    if ascii_file:
        lines = [" ".join(map(repr, row)) for row in rows.tolist()]
        lines += [" ".join(map(str, [len(polygon), *polygon])) for polygon in made.polygons]
        return content + "\n".join([*lines, ""]).encode()
    content += rows.astype("<" + code).tobytes()
    return content + b"".join(struct.pack(f"<B{len(polygon)}i", len(polygon), *polygon) for polygon in made.polygons)


def obj(made, with_normals):
    lines = ["v {!r} {!r} {!r}".format(*map(float, vertex)) for vertex in made.vertices]
    lines += ["vn {!r} {!r} {!r}".format(*map(float, normal)) for normal in (made.normals if with_normals else [])]
    lines += ["vt {!r} {!r}".format(*map(float, place)) for place in made.uv]
    last = None
    for polygon, name in zip(made.polygons, made.names, strict=True):
        if name != last:
            lines.append(f"o {name}")
            last = name
        form = (
            "{0}/{0}/{0}"
            if made.uv and with_normals
            else "{0}//{0}"
            if with_normals
            else "{0}/{0}"
            if made.uv
            else "{0}"
        )
        lines.append("f " + " ".join(form.format(index + 1) for index in polygon))
    return "\n".join([*lines, ""]).encode()


def off(made):
    lines = ["OFF", f"{len(made.vertices)} {len(made.polygons)} 0"]
    lines += ["{!r} {!r} {!r}".format(*map(float, vertex)) for vertex in made.vertices]
    return "\n".join([*lines, *(" ".join(map(str, [len(p), *p])) for p in made.polygons), ""]).encode()


def stl(made):
    corners = np.array(made.vertices)[np.array(made.polygons)]
    rows = np.zeros(len(corners), [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    rows["v"] = corners
    return bytes(80) + struct.pack("<I", len(rows)) + rows.tobytes()


def glb(made, with_normals, rng):
    """A node for each object, some of them moved, so that the file has other coordinates."""
    nodes, meshes, accessors, views, binary = [], [], [], [], b""

    def accessor(array, kind, component, **bounds):
        nonlocal binary
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": array.nbytes})
        binary += array.tobytes() + b"\0" * (-array.nbytes % 4)
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": len(array), "type": kind})
        accessors[-1] |= bounds
        return len(accessors) - 1

    for name in dict.fromkeys(made.names):
        polygons = [polygon for polygon, other in zip(made.polygons, made.names, strict=True) if other == name]
        used = sorted({index for polygon in polygons for index in polygon})
        row = {index: place for place, index in enumerate(used)}
        shift = rng.choice([0.0, 1.0]) * np.ptp(np.array(made.vertices), axis=0).max() * rng.normal(size=3)
        at = (np.array(made.vertices)[used] - shift).astype("<f4")
        attributes = {"POSITION": accessor(at, "VEC3", 5126, min=at.min(axis=0).tolist(), max=at.max(axis=0).tolist())}
        if with_normals:
            attributes["NORMAL"] = accessor(np.array(made.normals)[used].astype("<f4"), "VEC3", 5126)
        if made.uv:
            uv = np.array(made.uv)[used]
            attributes["TEXCOORD_0"] = accessor(np.stack([uv[:, 0], 1 - uv[:, 1]], -1).astype("<f4"), "VEC2", 5126)
        indices = np.array([[row[index] for index in polygon] for polygon in polygons], "<u4").ravel()
        primitive = {"attributes": attributes, "indices": accessor(indices, "SCALAR", 5125)}
        meshes.append({"primitives": [primitive]})
        nodes.append({"mesh": len(meshes) - 1, "name": name, "translation": shift.tolist()})
    document = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}]}
    document |= {"nodes": nodes, "meshes": meshes, "accessors": accessors, "bufferViews": views}
    text = json.dumps(document | {"buffers": [{"byteLength": len(binary)}]}).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def read_glb(content):
    """Places (n, 3) in the scene, and w (n,), of the vertices of a .glb, object after object."""
    (size,) = struct.unpack_from("<I", content, 12)
    document, binary = json.loads(content[20 : 20 + size]), content[28 + size :]

    def rows(number):
        stored = document["accessors"][number]
        view = document["bufferViews"][stored["bufferView"]]
        kind = {5126: "<f4", 5123: "<u2", 5121: "<u1"}[stored["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[stored["type"]]
        start = view.get("byteOffset", 0) + stored.get("byteOffset", 0)
        step = view.get("byteStride", 0) or width * np.dtype(kind).itemsize
        shape = (stored["count"], width)
        return np.ndarray(shape, kind, binary, start, (step, np.dtype(kind).itemsize)).astype(float)

    places, w = [], []
    for node in document["nodes"]:
        if "mesh" in node:
            for primitive in document["meshes"][node["mesh"]]["primitives"]:
                attributes = primitive["attributes"]
                places.append(rows(attributes["POSITION"]) + node.get("translation", (0, 0, 0)))
                w.append(rows(attributes["_OBSCURANCE"])[:, 0])
    return np.concatenate(places), np.concatenate(w)


def read_ply(content):
    """w (n,) of a binary .ply that the command has written."""
    head, body = content.split(b"end_header\n", 1)
    words = [line.split() for line in head.decode().splitlines()]
    (count,) = (int(line[2]) for line in words if line[:2] == ["element", "vertex"])
    kinds = {
        "float": "<f4",
        "double": "<f8",
        "uchar": "u1",
        "int": "<i4",
        "uint": "<u4",
        "ushort": "<u2",
        "short": "<i2",
    }
    table, inside = [], False
    for line in words:
        inside = line[1] == "vertex" if line[0] == "element" else inside
        if line[0] == "property" and inside:
            table.append((line[2], kinds.get(line[1], "<f4")))
    if b"format ascii" in head:
        rows = np.array([row.split() for row in body.decode().splitlines()[:count]], float)
        return rows[:, [name for name, _ in table].index("obscurance")]
    return np.frombuffer(body, table, count)["obscurance"].astype(float)
