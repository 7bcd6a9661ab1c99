"""Normals that are smooth but across creases: edges whose two faces lie more than 30° apart.

The faces of a vertex that follow one another across smooth edges are a fan, as in Blender's "smooth by angle", and fans
whose normals lie within 30° are one: so a crease that ends within the surface splits nothing, nor do T-junctions. Its
normal is the sum of the faces', weighted by angle (Thürmer & Wüthrich 1998). Vertices at one place count as one.
"""

from __future__ import annotations

import numpy as np

from ..types import Float64s, Int64s
from .components import connected_components
from .mesh import Mesh
from .normals import face_normals, nonzero, normalize, vertex_sums
from .placement import Placement
from .weld import CREASE, sum_groups, weld


def creased_normals(mesh: Mesh) -> tuple[Float64s, Int64s]:
    """Unit normals (k, 3), and which of them (m, 3) each corner of the faces has.

    A mesh's own normals stay, with the face's where a vertex has none; else fans. Faces without area have the
    normals of other faces at their vertices, or zero.
    """
    vertices, faces = Placement.of(mesh).vertices, mesh.faces
    across, areas = face_normals(vertices.astype(np.float64), faces)
    if mesh.normals is not None:
        known = normalize(mesh.normals)
        missing = len(known) + np.arange(len(faces))[:, None]
        return np.concatenate([known, across]), np.where(nonzero(known)[faces], faces, missing)
    places = weld(vertices, faces, np.ones((len(vertices), 3)), CREASE)[faces]
    fan = connected_components(_smooth_links(places, across), faces.size)
    corners = vertices[faces.ravel()].astype(np.float64)
    sums = sum_groups(fan, vertex_sums(corners, np.arange(faces.size).reshape(-1, 3), across, areas))
    first = np.unique(fan, return_index=True)[1]
    group = weld(vertices[faces.ravel()[first]], fan.reshape(-1, 3), normalize(sums), CREASE)
    of, flat = group[fan].reshape(-1, 3), areas == 0
    group_at = np.full(len(vertices), -1)
    group_at[faces[~flat]] = of[~flat]
    of[flat] = np.where(group_at[faces[flat]] >= 0, group_at[faces[flat]], of[flat])
    return normalize(sum_groups(group, sums)), of


def _smooth_links(places: Int64s, normals: Float64s) -> Int64s:
    """Pairs (j, 2) of corners at one end of a smooth edge, which two faces share that run along it in opposite ways.

    Args: places: (m, 3), a number for each corner's place. normals: (m, 3), of faces.
    """
    ends = np.stack([places.ravel(), np.roll(places, -1, axis=1).ravel()], axis=1)
    key = np.sort(ends, axis=1) @ [int(places.max()) + 1, 1]
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    starts = starts[np.diff(starts, append=len(key)) == 2]
    a, b = order[starts], order[starts + 1]
    smooth = (ends[a, 0] == ends[b, 1]) & (np.einsum("ij,ij->i", normals[a // 3], normals[b // 3]) >= CREASE)
    a, b = a[smooth], b[smooth]
    after_a, after_b = (each - each % 3 + (each + 1) % 3 for each in (a, b))
    return np.concatenate([np.stack([a, after_b], axis=1), np.stack([after_a, b], axis=1)])
