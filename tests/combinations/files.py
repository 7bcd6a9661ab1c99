"""Patches as mesh files, and where each vertex, face and texel of them lies."""

from dataclasses import dataclass, field

import mesh_files
import numpy as np
import trimesh
from gltf_files import Builder, check_glb, values


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


def content(made, form, rng, with_normals=False, text=False, double=True):
    """The bytes of a file. `text`, `double`: of a .ply."""
    columns = {"normals": made.normals if with_normals else None, "uv": made.uv or None}
    if form == "ply":
        return mesh_files.ply(made.vertices, made.polygons, kind="double" if double else "float", text=text, **columns)
    if form == "obj":
        return mesh_files.obj(made.vertices, made.polygons, names=made.names, **columns)
    if form == "off":
        return mesh_files.off(made.vertices, made.polygons)
    if form == "stl":
        return mesh_files.stl(np.array(made.vertices)[np.array(made.polygons)])
    return glb(made, with_normals, rng)


def glb(made, with_normals, rng):
    """A node for each object, some of them moved, so that the file has other coordinates."""
    builder, nodes = Builder(), []
    for name in dict.fromkeys(made.names):
        polygons = [polygon for polygon, other in zip(made.polygons, made.names, strict=True) if other == name]
        used, faces = np.unique(polygons, return_inverse=True)
        shift = rng.choice([0.0, 1.0]) * np.ptp(np.array(made.vertices), axis=0).max() * rng.normal(size=3)
        at = (np.array(made.vertices)[used] - shift).astype("<f4")
        piece = builder.primitive(at, faces, np.array(made.normals)[used] if with_normals else None)
        if made.uv:
            uv = np.array(made.uv)[used] * [1, -1] + [0, 1]
            piece["attributes"]["TEXCOORD_0"] = builder.accessor(uv.astype("<f4"), "VEC2")
        nodes.append({"mesh": builder.mesh(piece), "name": name, "translation": shift.tolist()})
    return builder.glb(nodes)


def read_glb(content):
    """Places (n, 3) in the scene, and w (n,), of the vertices of a .glb, object after object."""
    header, binary = check_glb(content)
    places, w = [], []
    for node in header["nodes"]:
        for primitive in header["meshes"][node["mesh"]]["primitives"]:
            attributes = primitive["attributes"]
            places.append(values(header, binary, attributes["POSITION"]) + np.array(node["translation"]))
            w.append(values(header, binary, attributes["_OBSCURANCE"]))
    return np.concatenate(places), np.concatenate(w).astype(float)


def read_ply(path):
    """w (n,), as trimesh reads it."""
    return trimesh.load(path, process=False).metadata["_ply_raw"]["vertex"]["data"]["obscurance"].astype(float)
