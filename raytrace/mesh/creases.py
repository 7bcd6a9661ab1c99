"""Normals that are smooth but across creases: edges whose two faces lie more than 30° apart.

The faces of a vertex that follow one another across smooth edges are a fan, as in Blender's "smooth by angle", and fans
whose normals lie within 30° are one: so a crease that ends within the surface splits nothing, nor do T-junctions. Its
normal is the sum of the faces', weighted by angle (Thürmer & Wüthrich 1998). Vertices at one place count as one.
"""

import numpy as np

from ..kernel.counting_sort import counting_sort
from ..kernel.jit import inline, kernel
from ..types import Float64s, Int64s
from .components import connect, number
from .mesh import Mesh
from .normals import face_normals, nonzero, normalize, vertex_sums
from .placement import Placement
from .weld import CREASE, cosine, sum_groups, weld


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
    fan = np.arange(faces.size)
    edges = counting_sort(np.minimum(places, places[:, [1, 2, 0]]), int(places.max()) + 1)
    _join_smooth(places.ravel(), across, *edges, fan)
    number(fan)
    corners = vertices[faces.ravel()].astype(np.float64)
    sums = sum_groups(fan, vertex_sums(corners, np.arange(faces.size).reshape(-1, 3), across, areas))
    first = np.flatnonzero(np.diff(np.maximum.accumulate(fan), prepend=-1))
    group = weld(vertices[faces.ravel()[first]], fan.reshape(-1, 3), normalize(sums), CREASE)
    of, flat = group[fan].reshape(-1, 3), areas == 0
    group_at = np.full(len(vertices), -1)
    group_at[faces[~flat]] = of[~flat]
    of[flat] = np.where(group_at[faces[flat]] >= 0, group_at[faces[flat]], of[flat])
    return normalize(sum_groups(group, sums)), of


@kernel
def _join_smooth(places, normals, edges, starts, fan):
    """Connect corners at one end of a smooth edge, which two faces share that run along it in opposite ways.

    Args:
        places: (3 m,), a number for each corner's place. normals: (m, 3), of faces.
        edges: edges[starts[i] : starts[i + 1]] have the lower end i; edge e begins at places[e].
        fan: (3 m,), a forest of corners.
    """
    count, pair = np.zeros(len(starts), np.int64), np.zeros((len(starts), 2), np.int64)
    for i in range(len(starts) - 1):
        for edge in edges[starts[i] : starts[i + 1]]:
            other = max(places[edge], places[_after(edge)])
            pair[other, min(count[other], 1)] = edge
            count[other] += 1
        for edge in edges[starts[i] : starts[i + 1]]:
            other = max(places[edge], places[_after(edge)])
            a, b = pair[other, 0], pair[other, 1]
            if count[other] == 2 and places[a] == places[_after(b)] and cosine(normals, a // 3, b // 3) >= CREASE:
                connect(fan, a, _after(b))
                connect(fan, _after(a), b)
            count[other] = 0


@inline
def _after(edge):
    return edge - edge % 3 + (edge + 1) % 3
