"""Samples of texels that no single triangle, or no set of triangles side by side, covers as a whole.

At the borders of charts, in tiny charts, and where a texel shows much of the surface, samples are spread over all that
the texel has of any triangle, clipped exactly. Where triangles lie over one another, each has equally many.
"""

from typing import NamedTuple

import numpy as np

from obscurance.raytrace.kernel.jit import inline, kernel
from obscurance.raytrace.sampling import hash32
from obscurance.raytrace.types import Float32Grid, Float64Grid, Float64s, Int32Rows, Int64s

from .places import OF_AREA, POINTS, SLOTS, Places, has_sample, point_in_texel, points_of_layers, shift
from .raster import EDGE, INSIDE, Lists, Marks, least_edge, set_up_edges, store_barycentric

MOST = 64  # samples of a texel; of more triangles over one another, as many have one, evenly spaced
NOT_SOUGHT, AREA, LAYERS = -1, 0, 1  # samples are spread over area, or over all triangles at points
_MORE = 16  # samples of a texel with several triangles, or with much surface
_CROWDED, _FULL = (
    8.0,
    32.0,
)  # texels of an even layout that would show as much; from so many on it has more samples, the most
_LEAST, _OF_TRIANGLE = 1e-9, 1e-6  # area, in texels, or part of the triangle's, that is any at all
_UNSEEN = 1e-3  # part of a texel's area that its points may miss
CORNERS = 8  # of a triangle cut by a square, at most 7
_FEW = 4  # layers that have a sample at each point; more have one each


class PartialTexels(NamedTuple):
    """Texels that are partly covered, whose samples are sought, h. Attributes: how: of `find_partial`."""

    texels: Int64s  # (h,), row · width + column
    how: Int64s  # (h,), AREA or LAYERS
    places: Places


@kernel
def find_partial(marks: Marks, crowding: Float64s, layered: bool, how: Int64s) -> None:
    """Write how samples of each texel are sought, int64 (n,), NOT_SOUGHT where its points will do or no triangle is.

    Texels with a point in no triangle lose their triangles in `Marks`, and overlaps the triangle at their centre.

    Args: crowding: (t,). layered: whether all triangles share a texel.
    """
    for i in range(len(how)):
        hits, most_crowding, overlapping = 0, 0.0, marks.overlapping[i]
        for k in range(SLOTS):
            if marks.triangle[i, k] >= 0:
                hits += 1
                most_crowding = max(most_crowding, crowding[marks.triangle[i, k]])
        crowded = most_crowding >= _CROWDED and (layered or not overlapping)
        hidden = layered and marks.charts[i] and not overlapping  # a chart may lie over another between the points
        sought = hits < SLOTS or crowded or (overlapping and layered) or hidden
        how[i] = NOT_SOUGHT
        if sought and marks.reaching[i] > 0:
            how[i] = LAYERS if layered and overlapping and not crowded else AREA
        for k in range(POINTS):
            if hits < SLOTS or ((overlapping or hidden) and k == SLOTS):
                marks.triangle[i, k] = -1


@kernel
def sample_partial(
    triangles: tuple[Float64Grid, Float64s],
    width: int,
    layered: bool,
    partial: PartialTexels,
    lists: Lists,
    out: tuple[Int64s, Int32Rows, Float32Grid],
) -> None:
    """Find samples of `PartialTexels`, none of a texel in which no triangle has an area.

    Args:
        triangles: their corners (t, 3, 2) and crowding (t,). lists: `Lists` of triangles that reach into the texels.
        layered: whether all triangles share a texel, or hide the triangles that are listed after them.
        out: how many samples (h,), their triangles (h, MOST) and barycentrics (h, MOST, 3), to be written.
    """
    corners, crowding = triangles
    counts, triangle, barycentric = out
    edges = np.empty((3, EDGE))
    clipped = np.empty((2, CORNERS, 2))
    points = np.empty((SLOTS, 2))
    for i in range(len(counts)):
        candidates = lists.triangle[lists.starts[i] : lists.starts[i + 1]]
        texel = np.float64(partial.texels[i] % width), np.float64(partial.texels[i] // width)
        for k in range(SLOTS):
            points[k] = point_in_texel(partial.places, i, partial.texels[i], k)
        offset = shift(partial.places, i, partial.texels[i], OF_AREA)
        texel_samples = triangle[i], barycentric[i]
        place = partial.texels[i], points, offset[0], points_of_layers(partial.places, i, partial.texels[i])
        if partial.how[i] == LAYERS and _cover_all(corners, candidates, texel, points, (clipped, edges)):
            counts[i] = _sample_layers(corners, candidates, texel, place, edges, texel_samples)
        else:
            counts[i] = _sample_area(corners, crowding, candidates, texel, offset, (clipped, edges), texel_samples)
            if not layered:
                _bring_to_top(corners, candidates, counts[i], edges, texel_samples)


@inline
def _sample_area(corners, crowding, candidates, texel, offset, scratch, out):
    """Spread samples over the area of the parts of all triangles in a texel; returns their number.

    Parts are fans of triangles, one after another, with a sample in each of equal steps of area: two and two opposite
    to one another, by which means of what is linear in area are exact.
    """
    clipped, edges = scratch
    total, sample_count = _measure(corners, crowding, candidates, texel, clipped)
    before, placed = 0.0, 0
    for t in candidates:
        area, count = clip_to_texel(corners[t], texel, clipped)
        if not _is_part(area, corners[t]):
            continue
        polygon = clipped[0]
        for corner in range(1, count - 1):
            part = area_of_fan(polygon, corner)
            # Samples whose step of area falls into this triangle of the fan.
            while placed < sample_count:
                along, sideways = _in_step(placed, offset)
                if (placed + along) * total >= (before + part) * sample_count:
                    break
                outwards = np.sqrt(((placed + along) * total / sample_count - before) / part)
                x = texel[0] + point_in_fan(polygon, corner, 0, outwards, sideways)
                y = texel[1] + point_in_fan(polygon, corner, 1, outwards, sideways)
                out[0][placed] = t
                set_up_edges(corners[t], edges)
                store_barycentric(edges, x, y, out[1][placed])
                placed += 1
            before += part
    return placed


@inline
def _cover_all(corners, candidates, texel, points, scratch):
    """Whether the triangles at the points of a texel are all that it has: whether the depth there is the area."""
    clipped, edges = scratch
    total = depth = 0.0
    for t in candidates:
        total += clip_to_texel(corners[t], texel, clipped)[0]
        area = set_up_edges(corners[t], edges)
        for k in range(SLOTS):
            inside = least_edge(edges, texel[0] + points[k, 0], texel[1] + points[k, 1]) > INSIDE * area
            depth += inside / SLOTS
    return abs(total - depth) < _UNSEEN * depth


@inline
def _measure(corners, crowding, candidates, texel, clipped):
    """The area of all parts of triangles in a texel, and how many samples it should have: more for several parts, or
    where many texels of an even layout would show as much of the surface."""
    total, weighted, parts = 0.0, 0.0, 0
    for t in candidates:
        area, _ = clip_to_texel(corners[t], texel, clipped)
        if _is_part(area, corners[t]):
            total += area
            weighted += area * crowding[t]
            parts += 1
    if parts <= 1 and weighted < _CROWDED:
        return total, SLOTS * parts
    return total, _MORE if weighted < _FULL and parts <= _MORE else MOST


@inline
def _is_part(area, triangle):
    """Whether an area within a texel is a part of its triangle, and no rounding."""
    return area > min(_LEAST, _OF_TRIANGLE * area_of_fan(triangle, 1))


@inline
def _sample_layers(corners, candidates, texel, place, edges, out):
    """Give all triangles over one another in a texel equally many samples, at its points; returns their number.

    Args: place: the texel's number, its points, from 0 to 1 where the first of thinned samples lies, and of
        `points_of_layers`.
    """
    number, points, offset, of_layers = place
    # How many triangles lie over one another at each point.
    depth = np.zeros(SLOTS, np.int64)
    for t in candidates:
        area = set_up_edges(corners[t], edges)
        for k in range(SLOTS):
            depth[k] += least_edge(edges, texel[0] + points[k, 0], texel[1] + points[k, 1]) > INSIDE * area
    deepest = max(max(depth[0], depth[1]), max(depth[2], depth[3]))
    # Samples are those of `has_sample`, thinned out evenly to MOST from a place of the texel's own on, so that texels
    # of many layers leave out different ones.
    sample_count = 0
    for k in range(SLOTS):
        for layer in range(depth[k]):
            sample_count += has_sample(layer, k, of_layers, deepest, _FEW)
    placed = min(sample_count, MOST)
    start = np.int64((hash32(number) * 2.0**-32 + offset) % 1.0 * sample_count)
    entry = 0
    depth[:] = 0
    for t in candidates:
        area = set_up_edges(corners[t], edges)
        for k in range(SLOTS):
            x = texel[0] + points[k, 0]
            y = texel[1] + points[k, 1]
            if least_edge(edges, x, y) > INSIDE * area:
                if has_sample(depth[k], k, of_layers, deepest, _FEW):
                    to = (start + entry * placed) // sample_count
                    if to < (start + (entry + 1) * placed) // sample_count:
                        out[0][to] = t
                        store_barycentric(edges, x, y, out[1][to])
                    entry += 1
                depth[k] += 1
    return placed


@inline
def _bring_to_top(corners, candidates, count, edges, out):
    """Move each sample to the first of the triangles that lie over one another at its place."""
    for k in range(count):
        triangle = corners[out[0][k]]
        x = y = 0.0
        for corner in range(3):
            x += out[1][k, corner] * triangle[corner, 0]
            y += out[1][k, corner] * triangle[corner, 1]
        for t in candidates:
            if t >= out[0][k]:
                break
            set_up_edges(corners[t], edges)
            if least_edge(edges, x, y) >= 0.0:
                out[0][k] = t
                store_barycentric(edges, x, y, out[1][k])
                break


@inline
def _in_step(k, offset):
    """Where sample k lies in its step of area, from 0 to 1, and across it."""
    across = (_radical_inverse(k >> 1) + offset[1]) % 1.0
    return (1.0 - offset[0], 1.0 - across) if k & 1 else (offset[0], across)


@inline
def _radical_inverse(k):
    """The radical inverse of k < 64 in base 2."""
    fraction = 0.0
    for bit in range(6):
        fraction += ((k >> bit) & 1) * 0.5 ** (bit + 1)
    return fraction


@inline
def area_of_fan(polygon, k):
    """The area of the triangle of the first corner, corner k and the next."""
    ax = polygon[k, 0] - polygon[0, 0]
    ay = polygon[k, 1] - polygon[0, 1]
    bx = polygon[k + 1, 0] - polygon[0, 0]
    by = polygon[k + 1, 1] - polygon[0, 1]
    return abs(ax * by - ay * bx) / 2.0


@inline
def point_in_fan(polygon, corner, axis, outwards, sideways):
    """A coordinate of a point between the first corner of a polygon, `corner` and the next."""
    a = polygon[0, axis]
    b = polygon[corner, axis]
    c = polygon[corner + 1, axis]
    return a + outwards * (b - a + sideways * (c - b))


@inline
def clip_to_texel(triangle, texel, clipped):
    """Area of what a triangle and a texel have in common (Sutherland & Hodgman 1974), and how many corners it has.

    Args: clipped: (2, CORNERS, 2), whose first polygon receives the corners, relative to the texel's.
    """
    count = 3
    for k in range(3):
        for axis in range(2):
            clipped[0, k, axis] = triangle[k, axis] - texel[axis]
    for side in range(4):  # to and fro between the two polygons
        count = _clip_side(clipped[side % 2], count, side // 2, side % 2 == 0, clipped[1 - side % 2])
    area = 0.0
    for k in range(1, count - 1):
        area += area_of_fan(clipped[0], k)
    return area, count


@inline
def _clip_side(polygon, count, axis, low, out):
    """Write the corners of a polygon that is cut at 0, or else at 1, of an axis; returns their number."""
    written = 0
    for k in range(count):
        ahead = (k + 1) % count
        here = polygon[k, axis] if low else 1.0 - polygon[k, axis]
        there = polygon[ahead, axis] if low else 1.0 - polygon[ahead, axis]
        if here >= 0.0:
            out[written, 0] = polygon[k, 0]
            out[written, 1] = polygon[k, 1]
            written += 1
        if (here < 0.0) != (there < 0.0):
            part = here / (here - there)
            for c in range(2):
                out[written, c] = polygon[k, c] + part * (polygon[ahead, c] - polygon[k, c])
            written += 1
    return written
