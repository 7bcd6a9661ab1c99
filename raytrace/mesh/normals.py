"""Face and vertex normals, and the normals at corners that a mesh is shaded with, shared by the baker and the renderer.

Degenerate faces (zero area) never contribute, and nothing here returns NaN: a normal that does not exist is zero.
A mesh is shaded with its own normals, and where it has none of use, with normals that are smooth but across creases.
Creases are edges whose two faces lie more than 30° apart. The faces of a vertex that follow one another across smooth
edges are a fan, as in Blender's "smooth by angle", and fans whose normals lie within 30° are one: so a crease that ends
within the surface splits nothing, nor do T-junctions. Vertices at one place count as one.
Source: Gouraud 1971 (equal), 12.31–12.33; Thürmer & Wüthrich 1998 (angle).
"""

from typing import Literal

import numpy as np

from ..kernel.arrays import counting_sort
from ..kernel.jit import inline, kernel
from ..kernel.vector import cross, divide, dot, length, load, load_triangle, scale, store, subtract
from ..system.parallel import each, parallel
from ..types import AnyFloats, AnyInts, Bools, Float32Rows, Float32s, Float64Rows, Float64s, Int32Rows, Int32s, Int64s
from .mesh import Mesh, PerCorner
from .placement import Placement
from .weld import CREASE, connect, cosine, renumber_components, sum_groups, weld

_ROUNDED = 0.01  # of normals that files store in bytes: a normal that lies in its face is not behind it
EPSILON = float(np.finfo(np.float64).eps)
Weighting = Literal["angle", "area", "equal"]


def normalize(vectors: Float64s) -> Float64s:
    """Unit vectors along `vectors` (…, 3); zero, and what is not finite, becomes zero."""
    result = np.ascontiguousarray(vectors, np.float64).reshape(-1, 3)
    out = np.empty(result.shape)
    _normalize(result, out)
    return out.reshape(np.shape(vectors))


def nonzero(vectors: Float64s | Bools) -> Bools:
    """Whether each of the `vectors` (n, 3) is other than zero, (n,)."""
    x, y, z = vectors.T
    return np.asarray((x != 0) | (y != 0) | (z != 0))


def face_normals(vertices: AnyFloats, faces: AnyInts) -> tuple[Float64s, Float64s]:
    """Unit normals (m, 3) and areas (m,) of triangles, as `normal_and_area` has them."""
    normals = np.empty((len(faces), 3))
    return normals, _measured(vertices, faces, normals)


def face_areas(vertices: AnyFloats, faces: AnyInts) -> Float64s:
    """Areas (m,) of triangles, zero for degenerate faces."""
    return _measured(vertices, faces, None)


def _measured(vertices: AnyFloats, faces: AnyInts, normals: Float64s | None) -> Float64s:
    """`face_areas`. Args: normals: to be written, too."""
    areas = np.empty(len(faces))
    _measure(_rows(vertices), np.ascontiguousarray(faces, np.int32), normals, areas)
    return areas


def vertex_sums(
    vertices: AnyFloats, faces: AnyInts, weighting: Weighting = "angle", backwards: Bools | None = None
) -> Float64s:
    """Weighted sums (n, 3) of the unit face normals at each vertex, zero where they cancel to rounding.

    Args:
        weighting: equal (12.31), area (12.32), or interior angle (12.33: as it is when a face is cut up).
        backwards: bool (m,), the faces whose normals count reversed; None: none.
    """
    sums = np.zeros((len(vertices), 3))
    corners = np.ascontiguousarray(faces, np.int32)
    _vertex_sums(_rows(vertices), corners, backwards, ("angle", "area", "equal").index(weighting), sums)
    return sums


def _rows(vertices: AnyFloats) -> AnyFloats:
    """Vertices as kernels take them: what is no float32 as float64."""
    single = getattr(vertices, "dtype", None) == np.float32
    return np.ascontiguousarray(vertices, np.float32 if single else np.float64)


def vertex_normals(vertices: AnyFloats, faces: AnyInts, weighting: Weighting = "angle") -> Float64s:
    """Unit vertex normals (n, 3); zero where no usable face meets the vertex or its faces cancel out.

    Args: vertices (n, 3) float64, any unit; faces (m, 3) indices.
    """
    return normalize(vertex_sums(vertices, faces, weighting))


@each("vectors")
def _normalize(i: int, vectors: Float64Rows, out: Float64Rows) -> None:
    """Write `normalized` rows of `vectors` (n, 3) to `out`."""
    store(out, i, normalized(load(vectors, i)))


@inline
def normalized(v):
    """The unit vector along `v`; zero, and what is not finite, becomes zero."""
    largest = max(abs(v[0]), abs(v[1]), abs(v[2]))
    if largest > 0.0 and np.isfinite(v[0]) and np.isfinite(v[1]) and np.isfinite(v[2]):
        scaled = divide(v, largest)  # no overflow or underflow in the squares
        return divide(scaled, length(scaled))
    return 0.0, 0.0, 0.0


@each("faces")
def _measure(
    f: int, vertices: Float32Rows | Float64Rows, faces: Int32Rows, normals: Float64Rows | None, areas: Float64s
) -> None:
    """Write `face_normals`, or without `normals` `face_areas`."""
    normal, areas[f] = normal_and_area(load_triangle(vertices, faces, f))
    if normals is not None:
        store(normals, f, normal)


@inline
def normal_and_area(corners):
    """The unit normal and the area of a triangle; both zero for a degenerate one.

    It is degenerate when its area is zero to rounding: below 4 ulp of the product of its two longest edges.
    """
    i, j, k = corners
    a = subtract(j, i)
    b = subtract(k, j)
    c = subtract(i, k)
    normal = cross(a, b)
    double_area = length(normal)
    aa = dot(a, a)
    bb = dot(b, b)
    cc = dot(c, c)
    shortest = min(aa, bb, cc)
    longest_two = np.sqrt(aa * bb if shortest == cc else (bb * cc if shortest == aa else cc * aa))
    if double_area > 4.0 * EPSILON * longest_two:
        return divide(normal, double_area), 0.5 * double_area
    return (0.0, 0.0, 0.0), 0.0


@parallel("sums", alone=True)
def _vertex_sums(
    start: int,
    stop: int,
    vertices: Float32Rows | Float64Rows,
    faces: Int32Rows,
    backwards: Bools | None,
    weighting: int,
    sums: Float64Rows,
) -> None:
    """Write `vertex_sums` of the vertices from `start` to `stop`; rounding is relative to the sum of the weights."""
    magnitude = np.zeros(stop - start)
    for f in range(len(faces)):
        if not (start <= faces[f, 0] < stop or start <= faces[f, 1] < stop or start <= faces[f, 2] < stop):
            continue
        normal, area = normal_and_area(load_triangle(vertices, faces, f))
        if backwards is not None:
            normal = scale(-1.0, normal) if backwards[f] else normal
        for corner in range(3):
            i = faces[f, corner]
            if start <= i < stop and area > 0.0:
                weight = area if weighting == 1 else 1.0  # (12.32), (12.31)
                if weighting == 0:  # (12.33)
                    here = load(vertices, i)
                    ahead = load(vertices, faces[f, (corner + 1) % 3])
                    behind = load(vertices, faces[f, (corner + 2) % 3])
                    weight = np.arctan2(2.0 * area, dot(subtract(ahead, here), subtract(behind, here)))
                magnitude[i - start] += weight
                for axis in range(3):
                    sums[i, axis] += weight * normal[axis]
    for i in range(start, stop):
        if max(abs(sums[i, 0]), abs(sums[i, 1]), abs(sums[i, 2])) <= 1e-12 * magnitude[i - start]:
            sums[i] = 0.0


def corner_normals(mesh: Mesh, own: bool = True) -> PerCorner:
    """The unit normals (k, 3) that a mesh is shaded with, and which of them (m, 3) each corner has.

    They are its own where these are of use (`own_normals`), and elsewhere those of fans. Corners of faces without area
    have the normals of other faces at their vertices, or zero. Args: own: whether the mesh's own are asked for.
    """
    given = own_normals(mesh) if own else None
    if given is None:
        return _fan_normals(mesh)
    normals, is_useful = given
    if is_useful.all():
        return normals
    ours = _fan_normals(mesh)
    count = len(normals.values)
    return PerCorner(np.concatenate([normals.values, ours.values]), np.where(is_useful, normals.of, count + ours.of))


def useless_normals(mesh: Mesh) -> int:
    """At how many corners the mesh's own normals are of no use; 0 without any."""
    own = own_normals(mesh)
    return 0 if own is None else int(np.count_nonzero(~own[1]))


def own_vertex_normals(mesh: Mesh) -> Float64s | None:
    """A mesh's own unit normals (n, 3) by vertex, zero where it has several or one of no use; None without any."""
    own = own_normals(mesh)
    if own is None:
        return None
    normals, is_useful = own
    corners, at_corners = mesh.faces.ravel(), normals.values[normals.of.ravel()]
    by_vertex = np.zeros(mesh.vertices.shape)
    by_vertex[corners] = at_corners
    by_vertex[corners[(by_vertex[corners] != at_corners).any(axis=1) | ~is_useful.ravel()]] = 0.0
    return by_vertex


def smooth_normals(vertices: Float32s, faces: Int32s, weighting: Weighting) -> Float64s:
    """Unit vertex normals (n, 3), or zero, one where vertices at one place have normals within 30°.

    Args: vertices: (n, 3), in render space.
    """
    sums = vertex_sums(vertices, faces, weighting)
    group = weld(vertices, faces, normalize(sums), CREASE)
    return normalize(sum_groups(group, sums))[group]


def own_normals(mesh: Mesh) -> tuple[PerCorner, Bools] | None:
    """A mesh's own normals by corner, of unit length, and at which corners (m, 3) they are of use; None without any.

    Of no use are those that are zero, not finite, or behind the face.
    """
    own = mesh.corner_normals
    if mesh.normals is not None:
        own = PerCorner(mesh.normals, mesh.faces)
    if own is None:
        return None
    normals = PerCorner(normalize(own.values), own.of)
    across, _ = face_normals(Placement.of(mesh).vertices.astype(np.float64), mesh.faces)
    is_useful = nonzero(normals.values)[normals.of]
    for corner in range(3):
        cosines = np.einsum("ij,ij->i", normals.values[normals.of[:, corner]], across)
        is_useful[:, corner] &= cosines >= -_ROUNDED
    return normals, is_useful


def _fan_normals(mesh: Mesh) -> PerCorner:
    """Normals of fans, and which of them (m, 3) each corner has."""
    vertices, faces = Placement.of(mesh).vertices, mesh.faces
    across, areas = face_normals(vertices.astype(np.float64), faces)
    # Fans: the corners at a point that smooth edges connect.
    corner_points = weld(vertices, faces, np.ones((len(vertices), 3)), CREASE)[faces]
    fan = np.arange(faces.size)
    edges = counting_sort(np.minimum(corner_points, corner_points[:, [1, 2, 0]]), int(corner_points.max()) + 1)
    _join_smooth(corner_points.ravel(), across, *edges, fan)
    renumber_components(fan)
    # Fans whose mean normals agree share one.
    corners = vertices[faces.ravel()].astype(np.float64)
    sums = sum_groups(fan, vertex_sums(corners, np.arange(faces.size).reshape(-1, 3)))
    first_corner = np.flatnonzero(np.diff(np.maximum.accumulate(fan), prepend=-1))
    group = weld(vertices[faces.ravel()[first_corner]], fan.reshape(-1, 3), normalize(sums), CREASE)
    of = group[fan].reshape(-1, 3)
    # Corners of faces without area take the normal of another face there.
    flat = areas == 0
    group_at = np.full(len(vertices), -1)
    group_at[faces[~flat]] = of[~flat]
    of[flat] = np.where(group_at[faces[flat]] >= 0, group_at[faces[flat]], of[flat])
    return PerCorner(normalize(sum_groups(group, sums)), of)


@kernel
def _join_smooth(corner_points: Int64s, normals: Float64Rows, edges: Int64s, starts: Int64s, fan: Int64s) -> None:
    """Connect corners at one end of a smooth edge, which two faces share that run along it in opposite ways.

    Args: corner_points: (3 m,), a number for each corner's place. fan: (3 m,), a forest of corners.
        edges: edges[starts[i] : starts[i + 1]] have the lower end i; edge e begins at places[e].
    """
    count = np.zeros(len(starts), np.int64)
    pair = np.zeros((len(starts), 2), np.int64)
    for i in range(len(starts) - 1):
        for edge in edges[starts[i] : starts[i + 1]]:
            other = max(corner_points[edge], corner_points[_after(edge)])
            pair[other, min(count[other], 1)] = edge
            count[other] += 1
        for edge in edges[starts[i] : starts[i + 1]]:
            other = max(corner_points[edge], corner_points[_after(edge)])
            a = pair[other, 0]
            b = pair[other, 1]
            if (
                count[other] == 2
                and corner_points[a] == corner_points[_after(b)]
                and cosine(normals, a // 3, b // 3) >= CREASE
            ):
                connect(fan, a, _after(b))
                connect(fan, _after(a), b)
            count[other] = 0


@inline
def _after(edge):
    """The edge after this one around its face; edges are numbered 3 f + k."""
    return edge - edge % 3 + (edge + 1) % 3
