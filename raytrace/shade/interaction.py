"""Surface interactions: from hits to points that can be lit, with interpolated normals and safe ray origins.

All of it sixteen points at a time, in lanes; a whole call is about one object. Polygons of more than three corners are
lit once under constant shading, else interpolated over as wholes.

Over a triangle u and v, a hit's barycentrics as Embree gives them, weigh corners 1 and 2, and 1 − u − v weighs corner
0. A normal that does not exist is the zero vector, which reflects nothing.

- constant: light `centroid` with the face's own normal once, for the whole face;
- Gouraud 1971: light the corners, then `interpolate` their colours;
- Phong 1975: light the hit with `phong_normal`;
- quadratic, van Overveld & Wyvill 1997: light the hit with `quadratic_normal`, which turns where linear
  interpolation stays flat.
"""

from typing import Any, NamedTuple

from ..brdf.material import BRUSHED, TO_LIGHT, TWO_SIDED
from ..kernel.jit import inline
from ..kernel.simd import bits, double, gather, gather3, load_row, lowest_bit, pick, select, single, some
from ..kernel.vector import add, choose, cross, dot, length, scale, subtract, triple, unit
from ..mesh.placement import ULP
from ..ray_origins.origins import OFFSET_ULPS
from . import layout
from .layout import lighting_column, load3, store1, store3

CONSTANT, FLAT, GOURAUD, PHONG, QUADRATIC = range(5)
SMOOTH = 0.8660254037844387  # cos 30°: a computed normal that leans away farther marks a hard edge
NEAR = 1e-9  # distance that counts as none, and sine of an angle that counts as 0 or π
GROWN = 2.0**30  # times the product of two edges is neither lost nor infinite in float32


@inline
def rotate(matrix, a):
    """The linear part of `matrix` (3, ≥3) times a."""
    return dot(triple(matrix[0], 0), a), dot(triple(matrix[1], 0), a), dot(triple(matrix[2], 0), a)


class PacketHits(NamedTuple):
    """Hits of sixteen viewing rays, lanes."""

    faces: Any  # int32, rows of the shapes' faces
    u: Any  # float32 barycentrics, the weights of corners 1 and 2
    v: Any
    depth: Any  # float32, distance to the viewer
    backward: Any  # unit directions against the rays, a triple


@inline
def corner_rows(geometry, item, mask, faces):
    """Rows in `geometry.vertices` of the corners of an object's `faces`; of its first face where the mask is unset."""
    return gather3(geometry.faces, select(mask, faces, 0) + geometry.first_face[item])


@inline
def corner(geometry, item, vertices):
    """Positions of vertices in render space."""
    p = gather3(geometry.vertices, vertices)
    if geometry.placed[item]:
        return p
    matrix = geometry.to_render[item]
    return add(rotate(matrix, p), (matrix[0, 3], matrix[1, 3], matrix[2, 3]))


@inline
def edges(geometry, item, i, j, k):
    """From corner i of faces to their corners j and k."""
    p0 = corner(geometry, item, i)
    return subtract(corner(geometry, item, j), p0), subtract(corner(geometry, item, k), p0)


@inline
def vertex_normal(geometry, item, vertices):
    """Unit normals of vertices in render space; zero for vertices without a normal."""
    n = gather3(geometry.normals, vertices)
    if geometry.placed[item]:
        return n
    return unit(rotate(geometry.normal_to_render[item], n))


@inline
def corner_normal(geometry, item, vertices, face):
    """A corner's unit normal in render space: the source's own, or a computed one unless it marks a hard edge."""
    n = vertex_normal(geometry, item, vertices)
    if geometry.authored[item]:
        return choose(dot(n, n) > 0.0, n, face)
    return choose(dot(n, face) > SMOOTH, n, face)


@inline
def face_normal(edge1, edge2):
    """Unit normal of a face from two edges; their product is rounded only once, however thin the face."""
    return unit(rounded(scale(GROWN, cross(doubled(edge1), doubled(edge2)))))


@inline
def next_object(items, left):
    """The object of the first of the lanes `left`, and the mask of those that are of it."""
    item = pick(items, lowest_bit(bits(left)))
    return item, left & (items == item)


@inline
def doubled(a):
    """A triple of lanes in double precision."""
    return double(a[0]), double(a[1]), double(a[2])


@inline
def rounded(a):
    """A triple of lanes in single precision."""
    return single(a[0]), single(a[1]), single(a[2])


@inline
def largest(p):
    """The largest of the absolute coordinates of points."""
    return max(max(abs(p[0]), abs(p[1])), abs(p[2]))


@inline
def lift(geometry, item, point, normal, size):
    """`point` moved along `normal` by more than the rounding of a hit on a triangle of coordinates up to `size`."""
    ulps = OFFSET_ULPS * ULP * (abs(normal[0]) + abs(normal[1]) + abs(normal[2]))
    return add(point, scale(ulps * max(geometry.magnitude[item], size), normal))


@inline
def smooth_origin(p, corners, normals, u, v):
    """The point on the surface that the normals describe, above `p` where the face cuts a convex one short.

    Source: Hanika 2021, "Hacking the Shadow Terminator".
    """
    n0, n1, n2 = normals
    d0 = min(0.0, dot(subtract(p, corners[0]), n0))
    d1 = min(0.0, dot(subtract(p, corners[1]), n1))
    d2 = min(0.0, dot(subtract(p, corners[2]), n2))
    rise = add(add(scale((1.0 - u - v) * d0, n0), scale(u * d1, n1)), scale(v * d2, n2))
    return subtract(p, rise)


@inline
def smooth_origins(p, corners, normals, u, v):
    """`smooth_origin` on the side of the normals, and on the other."""
    n0, n1, n2 = normals
    opposite = scale(-1.0, n0), scale(-1.0, n1), scale(-1.0, n2)
    return smooth_origin(p, corners, normals, u, v), smooth_origin(p, corners, opposite, u, v)


@inline
def between(a, b, c, u, v):
    """A float64 value interpolated in a face; where its corners' values are equal, exactly this value."""
    return a + (double(u) * (b - a) + double(v) * (c - a))


@inline
def tangents(geometry, i, j, k, edge1, edge2):
    """Unit directions in which u and v grow over the face, ∂p/∂u and ∂p/∂v; zero without texture coordinates."""
    u0 = double(gather(geometry.uv, 2 * i))
    v0 = double(gather(geometry.uv, 2 * i + 1))
    du1 = double(gather(geometry.uv, 2 * j)) - u0
    dv1 = double(gather(geometry.uv, 2 * j + 1)) - v0
    du2 = double(gather(geometry.uv, 2 * k)) - u0
    dv2 = double(gather(geometry.uv, 2 * k + 1)) - v0
    area = du1 * dv2 - du2 * dv1
    inverse = select(area == 0.0, 0.0, 1.0 / area)
    edge1 = doubled(edge1)
    edge2 = doubled(edge2)
    along_u = unit(scale(inverse, subtract(scale(dv2, edge1), scale(dv1, edge2))))
    along_v = unit(scale(inverse, subtract(scale(du1, edge2), scale(du2, edge1))))
    return rounded(along_u), rounded(along_v)


@inline
def lights_seen(geometry, item, side):
    """Whether lights reach points on their own side (`side` > 0) or from behind, as the column FRONT has it."""
    turns_to = geometry.materials[item, TWO_SIDED]
    front = layout.ON_BOTH_SIDES if turns_to == TO_LIGHT else layout.ON_THIS_SIDE
    return select(side > 0.0, front, front if turns_to != 0.0 else 0.0)


@inline
def towards_viewer(view, point):
    """Unit directions from points to the eye of a view."""
    if view.orthographic:
        return add(scale(0.0, point), scale(-1.0, triple(view.forward, 0)))
    return unit(subtract(triple(view.eye, 0), point))


@inline
def write_hits(packet, scene, item, mask, hits, view, style):
    """Write what lighting needs of hits on one object, in the lanes `mask`; returns their faces' unit normals on the
    viewer's side."""
    geometry = scene.geometry

    # the face, and its side that the viewer sees
    vertices = corner_rows(geometry, item, mask, hits.faces)
    i, j, k = vertices
    p0 = corner(geometry, item, i)
    p1 = corner(geometry, item, j)
    p2 = corner(geometry, item, k)
    edge1 = subtract(p1, p0)
    edge2 = subtract(p2, p0)
    outside = scale(geometry.mirrored[item], face_normal(edge1, edge2))
    side = select(dot(outside, hits.backward) >= 0.0, 1.0, -1.0)
    geometric = scale(side, outside)
    n0 = scale(side, corner_normal(geometry, item, i, outside))
    n1 = scale(side, corner_normal(geometry, item, j, outside))
    n2 = scale(side, corner_normal(geometry, item, k, outside))

    # what is lit: the hit, its normal interpolated, or the face's centroid
    point = add(p0, add(scale(hits.u, edge1), scale(hits.v, edge2)))
    flat = style.shading in (CONSTANT, FLAT)
    lit = point
    normal = geometric
    backward = hits.backward
    if flat:
        lit = centroid(p0, p1, p2)
        backward = towards_viewer(view, lit)
    elif style.shading == QUADRATIC:
        normal = quadratic_normal(p0, p1, p2, n0, n1, n2, hits.u, hits.v)
    else:
        normal = phong_normal(n0, n1, n2, hits.u, hits.v)
    store3(packet, layout.POINT, mask, lit)
    store3(packet, layout.NORMAL, mask, normal)
    store3(packet, layout.VIEW, mask, backward)
    store1(packet, layout.FRONT, mask, lights_seen(geometry, item, side))

    # where shadow rays start, on this side and on the other
    size = max(max(largest(p0), largest(p1)), largest(p2))
    ahead = point
    behind = point
    if style.terminator and not flat:
        ahead, behind = smooth_origins(point, (p0, p1, p2), (n0, n1, n2), hits.u, hits.v)
    store3(packet, layout.ORIGIN, mask, lift(geometry, item, ahead, geometric, size))
    if geometry.materials[item, TWO_SIDED] == TO_LIGHT:
        store3(packet, layout.BACK, mask, lift(geometry, item, behind, scale(-1.0, geometric), size))

    if geometry.materials[item, BRUSHED] == 1.0:
        store3(packet, layout.TANGENT, mask, tangents(geometry, i, j, k, edge1, edge2)[0])
    write_occlusion(packet, scene, item, mask, vertices, hits, style)
    return geometric


@inline
def write_occlusion(packet, scene, item, mask, vertices, hits, style):
    """Write w and the bent normals of hits, interpolated between the `vertices` of their faces."""
    shift = scene.geometry.first_w[item] - scene.geometry.first_vertex[item]
    i, j, k = vertices
    if style.weighted:
        w0 = gather(scene.w, i + shift)
        w1 = gather(scene.w, j + shift)
        w2 = gather(scene.w, k + shift)
        store1(packet, layout.W, mask, single(between(w0, w1, w2, hits.u, hits.v)))
    store3(packet, layout.BENT, mask, (0.0, 0.0, 0.0))
    if len(scene.bent) > 0:
        b0 = gather3(scene.bent, i + shift)
        b1 = gather3(scene.bent, j + shift)
        b2 = gather3(scene.bent, k + shift)
        store3(packet, layout.BENT, mask, interpolate(b0, b1, b2, hits.u, hits.v))


@inline
def polygons_hit(geometry, item, mask, faces):
    """The lanes of `mask` whose faces are parts of polygons; of these the row in `geometry.vertices`, the first edge,
    and the one after the last."""
    centres = len(geometry.vertices) - len(geometry.first_edge) + 1
    polygons = gather(geometry.polygons, select(mask, faces, 0) + geometry.first_face[item])
    there = mask & (polygons >= centres)
    polygons = select(there, polygons, centres)
    return (
        there,
        polygons,
        gather(geometry.first_edge, polygons - centres),
        gather(geometry.first_edge, polygons - centres + 1),
    )


@inline
def write_polygons(packet, geometry, item, mask, hits, view, style, face_normal):
    """Write what shading takes of whole polygons, after `write_hits`, whose result is `face_normal`."""
    mask, polygons, edge, end = polygons_hit(geometry, item, mask, hits.faces)
    newell = vertex_normal(geometry, item, polygons)
    side = select(dot(newell, face_normal) >= 0.0, 1.0, -1.0)
    if style.shading in (CONSTANT, FLAT):
        centre = corner(geometry, item, polygons)
        store3(packet, layout.POINT, mask, centre)
        store3(packet, layout.VIEW, mask, towards_viewer(view, centre))
        store3(packet, layout.NORMAL, mask, scale(side, newell))
    elif style.shading != QUADRATIC:
        point = load3(packet, layout.POINT)
        left = mask
        total = 0.0 * point[0]
        normal = scale(0.0, point)
        while some(left):  # Phong 1975: normals at the corners interpolated, renormalised
            i, j, a, b = edge_weights(geometry, item, edge, point, newell)
            n = corner_normal(geometry, item, i, newell)
            m = corner_normal(geometry, item, j, newell)
            normal = choose(left, add(normal, add(scale(a, n), scale(b, m))), normal)
            total = select(left, total + a + b, total)
            left = left & (edge + 1 < end)
            edge = select(left, edge + 1, edge)
        store3(packet, layout.NORMAL, mask, scale(side, unit(scale(1.0 / total, normal))))


@inline
def edge_weights(geometry, item, edge, point, newell):
    """The two vertices of an edge of a polygon, and what it adds to the weight of either at a point.

    Values at corners are weighted by mean value coordinates: λ_i = w_i/Σ w, w_i = (tan(α_{i−1}/2) + tan(α_i/2))/r_i,
    where edge i is seen from the point in the angle α_i, and corner i stands r_i away. They are smooth within, linear
    along edges, barycentric on a triangle, and the same however the polygon is turned or cut into triangles. A polygon
    that is not flat is seen along its Newell normal.
    Source: Hormann & Floater 2006, "Mean Value Coordinates for Arbitrary Planar Polygons".
    """
    i = gather(geometry.edges, 2 * edge)
    j = gather(geometry.edges, 2 * edge + 1)
    a = subtract(corner(geometry, item, i), point)
    b = subtract(corner(geometry, item, j), point)
    a = subtract(a, scale(dot(a, newell), newell))
    b = subtract(b, scale(dot(b, newell), newell))
    near = max(length(a), NEAR)
    far = max(length(b), NEAR)
    size = near * far
    along = dot(a, b)
    across = dot(cross(a, b), newell)
    across = select(abs(across) < NEAR * size, NEAR * size, across)
    tangent = select(along > 0.0, across / (size + along), (size - along) / across)
    return i, j, tangent / near, tangent / far


@inline
def polygon_light(packet, scene, item, mask, hits, first_row):
    """Gouraud 1971: the light of polygons' vertices, from `first_row` of `scene.lit_vertices` on, interpolated."""
    geometry = scene.geometry
    lit = scene.lit_vertices
    width = lit.shape[1]
    hit, polygons, edge, end = polygons_hit(geometry, item, mask, hits.faces)
    point = load3(packet, layout.POINT)
    newell = vertex_normal(geometry, item, polygons)
    for column in range(width):
        store1(packet, lighting_column(column), hit, 0.0)
    # Sum over the edges of each lane's polygon; lanes drop out as theirs end.
    total = 0.0 * point[0]
    left = hit
    while some(left):
        i, j, a, b = edge_weights(geometry, item, edge, point, newell)
        for column in range(width):
            at = first_row * width + column
            share = a * single(gather(lit, i * width + at)) + b * single(gather(lit, j * width + at))
            store1(packet, lighting_column(column), left, load_row(packet, lighting_column(column)) + share)
        total = select(left, total + a + b, total)
        left = left & (edge + 1 < end)
        edge = select(left, edge + 1, edge)
    for column in range(width):
        store1(packet, lighting_column(column), hit, load_row(packet, lighting_column(column)) / total)


@inline
def interpolate(a0, a1, a2, u, v):
    """(1 − u − v) a0 + u a1 + v a2: positions, colours, texture coordinates."""
    return add(add(scale(1.0 - u - v, a0), scale(u, a1)), scale(v, a2))


@inline
def centroid(p0, p1, p2):
    """The point at which a constantly shaded face is lit."""
    return scale(1.0 / 3.0, add(add(p0, p1), p2))


@inline
def phong_normal(n0, n1, n2, u, v):
    """Linear interpolation of unit normals, renormalised."""
    return unit(interpolate(n0, n1, n2, u, v))


@inline
def edge_term(p0, p1, n0, n1):
    """n_ij = n_i + n_j − a_ij, where a = 3((n_i + n_j)·w)/(w·w) w makes ∫ n(s)·w ds = 0 along the edge w."""
    total = add(n0, n1)
    w = subtract(p1, p0)
    length2 = dot(w, w)
    return subtract(total, scale(select(length2 > 0.0, 3.0 * dot(total, w) / length2, 0.0), w))


@inline
def quadratic_normal(p0, p1, p2, n0, n1, n2, u, v):
    """n = Σ n_i λ_i² + Σ_{i<j} n_ij λ_i λ_j, renormalised; on an edge it is n0 + b s + a s² of the paper."""
    t = 1.0 - u - v
    squares = add(add(scale(t * t, n0), scale(u * u, n1)), scale(v * v, n2))
    along_first = edge_term(p0, p1, n0, n1)
    second = edge_term(p1, p2, n1, n2)
    third = edge_term(p0, p2, n0, n2)
    return unit(add(add(squares, scale(t * u, along_first)), add(scale(u * v, second), scale(t * v, third))))
