"""Mesh files made by hand, and bakes made up, for the tests."""

import math
import struct
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gltf_files import HALVES, QUAD, Builder

from obscurance import ao
from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.mesh.mesh import Mesh
from obscurance.scenes.asset.asset import Asset
from obscurance.scenes.formats.load import load

# Two squares that share an edge; vertex 2 repeats vertex 1, vertex 6 is unused.
VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.25], [2, 0, 0], [9, 9, 9]])
FACES = np.array([[0, 1, 3], [0, 3, 4], [2, 5, 3]])
NORMALS = np.tile([0.0, 0.6, 0.8], (len(VERTICES), 1))


def ply(vertices=VERTICES, faces=FACES, order="<", normals=None, uv=None, kind="float", text=False):
    """A PLY file, whose faces have one number of corners."""
    columns = {("x", "y", "z"): vertices, ("nx", "ny", "nz"): normals, ("s", "t"): uv}
    columns = {names: np.asarray(column, float) for names, column in columns.items() if column is not None}
    form = "ascii" if text else f"binary_{'little' if order == '<' else 'big'}_endian"
    header = ["ply", f"format {form} 1.0", f"element vertex {len(vertices)}"]
    header += [f"property {kind} {name}" for names in columns for name in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = np.concatenate([*columns.values()], axis=1)
    if text:
        return "\n".join([*header, *_lines(rows.tolist()), *_lines([len(face), *face] for face in faces), ""]).encode()
    sides = np.shape(faces)[1] if len(faces) else 3
    packed = np.zeros(len(faces), dtype=[("n", "u1"), ("i", f"{order}i4", sides)])
    packed["n"], packed["i"] = sides, np.reshape(faces, (-1, sides))
    rows = rows.astype(order + {"float": "f4", "double": "f8"}[kind])
    return "\n".join([*header, ""]).encode() + rows.tobytes() + packed.tobytes()


def _lines(rows):
    return [" ".join(map(str, row)) for row in rows]


def ascii_ply(vertices=VERTICES, faces=FACES):
    return ply(vertices, faces, kind="double", text=True)


def off(vertices=VERTICES, faces=FACES):
    rows = [*_lines(np.asarray(vertices).tolist()), *_lines([len(face), *face] for face in faces)]
    return "\n".join(["OFF", "# made for a test", f"{len(vertices)} {len(faces)} 0", *rows, ""]).encode()


def obj(vertices=VERTICES, faces=FACES, normals=None, uv=None, names=None, of=None):
    """Args: names: of the objects of the faces, one after the other; of: the normals at corners, not the vertices'."""
    columns = {"v": vertices, "vn": normals, "vt": uv}
    rows = [f"{key} {line}" for key, column in columns.items() if column is not None for line in _lines(column)]
    corner = "{0}/{0}" if uv is not None else "{0}"
    corner += "" if normals is None else "/{1}" if uv is not None else "//{1}"
    last = None
    for number, face in enumerate(faces):
        if names and names[number] != last:
            last = names[number]
            rows.append(f"o {last}")
        pairs = zip(face, face if of is None else of[number], strict=True)
        rows.append("f " + " ".join(corner.format(index + 1, normal + 1) for index, normal in pairs))
    return "\n".join([*rows, ""]).encode()


def stl(triangles):
    packed = np.zeros(len(triangles), dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    packed["v"] = triangles
    return bytes(80) + len(triangles).to_bytes(4, "little") + packed.tobytes()


def ascii_stl(*solids):
    lines = []
    for name, triangles in solids:
        lines.append(f"solid {name}")
        for triangle in triangles:
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += ["vertex {} {} {}".format(*corner) for corner in triangle]
            lines += ["endloop", "endfacet"]
        lines.append(f"endsolid {name}")
    return "\n".join([*lines, ""]).encode()


def glb():
    builder = Builder()
    builder.mesh(builder.primitive(QUAD, HALVES))
    return builder.glb([{"mesh": 0, "name": "quad"}])


def read(tmp_path, name, data):
    path = tmp_path / name
    path.write_bytes(data)
    return load(path)


def mistake(tmp_path, name, data):
    """The message of the error that loading `data` must give."""
    with pytest.raises(MeshError) as error:
        read(tmp_path, name, data)
    message = str(error.value)
    assert "\n" not in message
    assert str(tmp_path / name) in message
    return message


def mixed_ply(order="<"):
    """Triangles, a quadrilateral and a pentagon, with a list and a number of no interest in each row."""
    header = ["ply", f"format binary_{'little' if order == '<' else 'big'}_endian 1.0"]
    header += [f"element vertex {len(VERTICES)}", *(f"property double {name}" for name in ("x", "y", "z"))]
    header += [*(f"property float {name}" for name in ("nx", "ny", "nz")), "element face 3", "property uchar flags"]
    header += ["property list uchar int vertex_indices", "property list uchar float texcoord", "end_header\n"]
    rows = np.zeros(len(VERTICES), dtype=[("v", f"{order}f8", 3), ("n", f"{order}f4", 3)])
    rows["v"], rows["n"] = VERTICES, NORMALS
    data = "\n".join(header).encode() + rows.tobytes()
    for polygon in MIXED:
        data += struct.pack(f"{order}BB{len(polygon)}iB2f", 7, len(polygon), *polygon, 2, 0.5, 0.5)
    return data


MIXED = [[0, 1, 3], [0, 1, 5, 3, 4], [2, 5, 3, 0]]
MIXED_FANS = [[0, 1, 3], [0, 1, 5], [0, 5, 3], [0, 3, 4], [2, 5, 3], [2, 3, 0]]

XYZ = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0], [0, 2, 0], [3, 3, 1]], dtype=">f4")
POLYGONS = [[0, 1, 2, 3, 4], [1, 5, 2], [0, 1, 3, 4]]


def rich_ply(colors=((250, 10, 0, 255),) * 6):
    """Big-endian, with texture coordinates, colours, a quality, polygons with flags and lists, and edges."""
    header = ["ply", "format binary_big_endian 1.0", "comment TextureFile paint.png"]
    header += ["obj_info made by hand", "comment Gr\u00fc\u00dfe", "element vertex 6"]
    header += [*(f"property float {name}" for name in ("x", "y", "z", "s", "t")), "property double quality"]
    header += [*(f"property uchar {name}" for name in ("red", "green", "blue", "alpha")), "element face 3"]
    header += ["property ushort flags", "property list uchar int vertex_indices", "property list uchar float weights"]
    header += ["element edge 1", "property int vertex1", "property int vertex2", "end_header\n"]
    data = "\n".join(header).encode("latin-1")
    for number, (place, color) in enumerate(zip(XYZ, colors, strict=True)):
        data += struct.pack(">5fd4B", *place, number / 8, number / 4, 0.5 * number, *color)
    for polygon in POLYGONS:
        data += struct.pack(f">HB{len(polygon)}iB1f", 7 + len(polygon), len(polygon), *polygon, 1, 0.25)
    return data + struct.pack(">2i", 0, 5)


def mesh_file(vertices=QUAD, faces=((0, 1, 2), (0, 2, 3)), normals=None):
    return Asset.of(Mesh(vertices, faces, normals, source="m"))


def random_bake(count):
    rng = np.random.default_rng(5)
    return SimpleNamespace(
        w=rng.random(count),
        error=rng.random(count) / 100,
        bent_normals=rng.normal(size=(count, 3)),
        flags=rng.integers(0, 8, count),
        profile=None,
        at="vertices",
        below=None,
    )


def with_profile(baked, columns=10, seed=0, limit=math.inf):
    """A bake with a profile of random numbers, the first of which are 0 and 1, of falloffs that end at a limit."""
    values = np.random.default_rng(seed).random((len(baked.w), columns), np.float32)
    values[:2, 0] = 0, 1
    lengths = 0.0051 * baked.mesh.radius * 2.0 ** np.arange(columns)
    return replace(baked, profile=ao.Profile(lengths, values, baked.mesh.radius, limit))
