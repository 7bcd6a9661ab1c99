"""Gouraud shading: vertices lit once before the picture is made, and their light interpolated over faces.

Which side of a vertex is seen is a matter of the face that is hit: a closed body's faces are seen from without, also
around vertices just over the horizon, whose normals point away from the viewer.
"""

import numpy as np

from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, gather, gather3, lane_numbers, load_row, select, single, store_row
from ..kernel.vector import add, dot, multiply, scale
from ..types import Float32Rows, Int64s
from . import layout
from .camera_rays import View
from .film import PACKETS
from .interaction import between, corner, corner_rows, lights_seen, polygon_light, towards_viewer, vertex_normal
from .layout import BOOK, OFF, SceneArrays, Scratch, Style, lighting_column, load3, store1, store3
from .lighting import light_packets

GROUP = PACKETS * WIDE  # vertices lit together


@kernel
def light_vertices(
    scene: SceneArrays, view: View, style: Style, scratch: Scratch, origins: Float32Rows, groups: Int64s
) -> None:
    """Gouraud 1971, first step: light rows of `scene.lit_vertices`, one side of one object at a time.

    Args: origins: as `write_vertices` has them; groups: int64 (k,), where `GROUP` rows begin, or the last of an object.
    """
    geometry, out = scene.geometry, scene.lit_vertices
    for begin in groups:
        seen_from_behind = begin >= len(scene.w)
        shift = len(scene.w) if seen_from_behind else 0
        side = -1.0 if seen_from_behind else 1.0
        # The object of these rows, and where its part of them ends.
        item = np.searchsorted(geometry.first_w, begin - shift, side="right") - 1
        end = min(begin + GROUP, geometry.first_w[item + 1] + shift)
        packets = -(-(end - begin) // WIDE)
        for e in range(packets):
            packet = scratch.points[e]
            k = begin + e * WIDE
            mask = lane_numbers() < end - k
            at = select(mask, lane_numbers(), 0) + (k - shift)
            write_vertices(packet, scene, origins, item, mask, at, view, side)
            store_row(scratch.items, e, select(mask, item, -1))
        # Their light, copied from the packets.
        light_packets(geometry, scene.lights, style, scratch, packets)
        for e in range(packets):
            for lane in range(min(WIDE, end - begin - e * WIDE)):
                for column in range(out.shape[1]):
                    out[begin + e * WIDE + lane, column] = scratch.points[e, lighting_column(column), lane]


@inline
def write_vertices(packet, scene, origins, item, mask, w_rows, view, side):
    """Write a packet of vertices, in `w_rows` of `scene.w`, seen from where their normals point, or if `side` is
    −1.0 from behind.

    Args: origins: of `BuiltGeometry.vertex_origins`, or none where no shadow is looked for.
    """
    geometry = scene.geometry
    w = scene.w
    bent = scene.bent
    vertices = w_rows + (geometry.first_vertex[item] - geometry.first_w[item])
    point = corner(geometry, item, vertices)
    store3(packet, layout.POINT, mask, point)
    ahead = point
    behind = point
    if len(origins) > 0:  # those of vertices seen from behind come last
        last = len(origins) - len(w)
        ahead = gather3(origins, w_rows + (0 if side > 0.0 else last))
        behind = gather3(origins, w_rows + (last if side > 0.0 else 0))
    store3(packet, layout.ORIGIN, mask, ahead)
    store3(packet, layout.BACK, mask, behind)
    store3(packet, layout.NORMAL, mask, scale(side, vertex_normal(geometry, item, vertices)))
    store3(packet, layout.VIEW, mask, towards_viewer(view, point))
    store3(packet, layout.ALBEDO_MAP, mask, (1.0, 1.0, 1.0))
    store3(packet, layout.BENT, mask, (0.0, 0.0, 0.0))
    if len(bent) > 0:
        store3(packet, layout.BENT, mask, gather3(bent, w_rows))
    store3(packet, layout.TANGENT, mask, (0.0, 0.0, 0.0))
    store1(packet, layout.FRONT, mask, lights_seen(geometry, item, side))
    store1(packet, layout.W, mask, single(gather(w, w_rows)))


@inline
def interpolate_lit(packet, scene, item, mask, hits, style, face_normal):
    """Gouraud 1971: the light of hits is interpolated between their faces' corners', on the side that is seen.

    ALBEDO_MAP and OCCLUSION, which vertices are lit without, are multiplied in. Args: face_normal: of `write_hits`.
    """
    geometry, lit = scene.geometry, scene.lit_vertices
    i, j, k = corner_rows(geometry, item, mask, hits.faces)
    n0 = vertex_normal(geometry, item, i)
    n1 = vertex_normal(geometry, item, j)
    n2 = vertex_normal(geometry, item, k)
    behind = dot(add(add(n0, n1), n2), face_normal) < 0.0

    # the rows of the side that is seen, interpolated
    width = lit.shape[1]
    shift = geometry.first_w[item] - geometry.first_vertex[item]
    first_row = select(behind, shift + len(lit) - len(scene.w), shift)
    for column in range(width):
        at = first_row * width + column
        a = gather(lit, i * width + at)
        b = gather(lit, j * width + at)
        c = gather(lit, k * width + at)
        store1(packet, lighting_column(column), mask, single(between(a, b, c, hits.u, hits.v)))
    if len(geometry.polygons) > 0:
        polygon_light(packet, scene, item, mask, hits, first_row)

    if len(lit) == len(scene.w):  # backs are not lit: they reflect no lamp
        for column in range(layout.DIFFUSE, layout.EMISSION):
            store1(packet, column, mask & behind, 0.0)
        store1(packet, layout.UNSHADOWED, mask & behind, 0.0)
        store1(packet, layout.SHADOWED, mask & behind, 0.0)

    # what is not linear between vertices
    unshadowed = load_row(packet, layout.UNSHADOWED)
    shadowed = load_row(packet, layout.SHADOWED)
    store1(packet, layout.SHADOW, mask, select(unshadowed > 0.0, shadowed / unshadowed, 1.0))
    albedo = load3(packet, layout.ALBEDO_MAP)
    occlusion = load_row(packet, layout.OCCLUSION)
    store3(packet, layout.AMBIENT, mask, multiply(load3(packet, layout.AMBIENT), albedo))
    store3(packet, layout.DIFFUSE, mask, multiply(load3(packet, layout.DIFFUSE), albedo))
    if style.form != OFF:
        store3(packet, layout.AMBIENT, mask, scale(occlusion, load3(packet, layout.AMBIENT)))
    if style.form == BOOK:
        store3(packet, layout.DIFFUSE, mask, scale(occlusion, load3(packet, layout.DIFFUSE)))
