"""Polygons of more than three corners: lit once under constant shading, else interpolated over as wholes.

Values at the corners are weighted by mean value coordinates: λ_i = w_i/Σ w, w_i = (tan(α_{i−1}/2) + tan(α_i/2))/r_i,
where edge i is seen from the point in the angle α_i, and corner i stands r_i away. They are smooth within, linear along
edges, barycentric on a triangle, and the same however the polygon is turned or cut into triangles. A polygon that is
not flat is seen along its Newell normal.
Source: Hormann & Floater 2006, "Mean Value Coordinates for Arbitrary Planar Polygons".
"""

from ..kernel.jit import inline
from ..kernel.simd import gather, load_row, select, single, some
from ..kernel.vector import add, choose, cross, dot, length, scale, subtract, unit
from . import layout
from .interaction import CONSTANT, FLAT, QUADRATIC, corner, corner_normal, towards_viewer, vertex_normal
from .layout import lighting_column, load3, store1, store3

NEAR = 1e-9  # distance that counts as none, and sine of an angle that counts as 0 or π


@inline
def polygons_hit(geometry, item, mask, faces):
    """The lanes of `mask` whose faces are parts of polygons, and the polygons' rows in `geometry.vertices`."""
    first = len(geometry.vertices) - len(geometry.first_edge) + 1
    rows = gather(geometry.polygons, select(mask, faces, 0) + geometry.first_face[item])
    there = mask & (rows >= first)
    return there, select(there, rows, first)


@inline
def write_polygons(packet, geometry, item, mask, hits, view, style, face_normal):
    """Write what shading takes of whole polygons, after `write_hits`, whose result is `face_normal`."""
    mask, rows = polygons_hit(geometry, item, mask, hits.faces)
    newell = vertex_normal(geometry, item, rows)
    side = select(dot(newell, face_normal) >= 0.0, 1.0, -1.0)
    if style.shading in (CONSTANT, FLAT):
        centre = corner(geometry, item, rows)
        store3(packet, layout.POINT, mask, centre)
        store3(packet, layout.VIEW, mask, towards_viewer(view, centre))
        store3(packet, layout.NORMAL, mask, scale(side, newell))
    elif style.shading != QUADRATIC:
        normal = polygon_normal(geometry, item, mask, rows, load3(packet, layout.POINT))
        store3(packet, layout.NORMAL, mask, scale(side, normal))


@inline
def polygon_edges(geometry, rows):
    """First edge of polygons, and the one after their last."""
    number = rows - (len(geometry.vertices) - len(geometry.first_edge) + 1)
    return gather(geometry.first_edge, number), gather(geometry.first_edge, number + 1)


@inline
def edge_weights(geometry, item, edge, point, newell):
    """The two vertices of an edge of a polygon, and what it adds to the weight of either at a point."""
    i, j = gather(geometry.edges, 2 * edge), gather(geometry.edges, 2 * edge + 1)
    a, b = subtract(corner(geometry, item, i), point), subtract(corner(geometry, item, j), point)
    a, b = subtract(a, scale(dot(a, newell), newell)), subtract(b, scale(dot(b, newell), newell))
    near, far = max(length(a), NEAR), max(length(b), NEAR)
    size, along, across = near * far, dot(a, b), dot(cross(a, b), newell)
    across = select(abs(across) < NEAR * size, NEAR * size, across)
    tangent = select(along > 0.0, across / (size + along), (size - along) / across)
    return i, j, tangent / near, tangent / far


@inline
def polygon_normal(geometry, item, mask, rows, point):
    """Phong 1975: unit normals at the corners interpolated at points of polygons, renormalised."""
    newell = vertex_normal(geometry, item, rows)
    edge, end = polygon_edges(geometry, rows)
    total, sum_ = 0.0 * point[0], scale(0.0, point)
    while some(mask):
        i, j, a, b = edge_weights(geometry, item, edge, point, newell)
        n, m = corner_normal(geometry, item, i, newell), corner_normal(geometry, item, j, newell)
        sum_ = choose(mask, add(sum_, add(scale(a, n), scale(b, m))), sum_)
        total = select(mask, total + a + b, total)
        mask = mask & (edge + 1 < end)
        edge = select(mask, edge + 1, edge)
    return unit(scale(1.0 / total, sum_))


@inline
def polygon_light(packet, scene, item, mask, hits, first_row):
    """Gouraud 1971: the light of polygons' vertices, from `first_row` of `scene.lit_vertices` on, interpolated."""
    geometry, lit = scene.geometry, scene.lit_vertices
    width = lit.shape[1]
    there, rows = polygons_hit(geometry, item, mask, hits.faces)
    point, newell = load3(packet, layout.POINT), vertex_normal(geometry, item, rows)
    for column in range(width):
        store1(packet, lighting_column(column), there, 0.0)
    edge, end = polygon_edges(geometry, rows)
    total, left = 0.0 * point[0], there
    while some(left):
        i, j, a, b = edge_weights(geometry, item, edge, point, newell)
        for column in range(width):
            at = first_row * width + column
            more = a * single(gather(lit, i * width + at)) + b * single(gather(lit, j * width + at))
            store1(packet, lighting_column(column), left, load_row(packet, lighting_column(column)) + more)
        total = select(left, total + a + b, total)
        left = left & (edge + 1 < end)
        edge = select(left, edge + 1, edge)
    for column in range(width):
        store1(packet, lighting_column(column), there, load_row(packet, lighting_column(column)) / total)
