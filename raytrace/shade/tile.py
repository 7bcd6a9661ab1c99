"""One tile of a picture: viewing rays in packets, their hits lit together, converged pixels retired early.

A pixel's first few samples decide together with its neighbours' whether it needs more, and so do the further samples of
neighbours that do. Those in other tiles are known only when all tiles have been rendered, so pixels about which they
disagree are taken up again then.
"""

import numpy as np

from ..brdf.material import ALPHA, MODEL
from ..embree import DIR_X, TNEAR
from ..kernel.jit import inline, kernel
from ..kernel.simd import WIDE, count, double, gather, lane_numbers, load_row, pick, select, single, some, store_row
from ..kernel.vector import multiply, scale, triple
from ..lights.kernels import RADIUS
from ..types import Bools
from . import layout
from .alpha_filter import MET_ALPHA, STEP
from .camera_rays import View, aim, write_discs
from .film import (
    BITS,
    FIRST,
    LAST,
    TILE,
    accumulate,
    clear,
    converged,
    load_edges,
    mean,
    store_edges,
    store_retired,
    widen,
    write_pixels,
)
from .gouraud import interpolate_lit
from .interaction import GOURAUD, PacketHits, next_object, write_hits, write_polygons
from .layout import (
    BACKGROUND,
    BEGIN,
    COVER,
    NEXT,
    PRIMARY,
    RETIRED,
    Film,
    SceneArrays,
    Scratch,
    Style,
    load3,
    store1,
    store3,
)
from .lighting import light_packets
from .texturing import map_albedo, map_grain, map_occlusion
from .transparency import begin_layers, closest_hits, composite


@kernel
def render_tiles(
    scene: SceneArrays,
    view: View,
    style: Style,
    film: Film,
    scratch: Scratch,
    span: tuple[int, int],
    reopened_only: bool,
) -> None:
    """Render the tiles [span[0], span[1]), counted along the rows of the film: a few samples of all pixels of a
    tile, then more of the pixels about which samples disagree.

    Textures whose `scratch.missing` is set afterwards are to be read, and the tiles to be rendered once more.

    Args:
        reopened_only: render only the pixels that need all samples after all, by the `edges` that a first call for all
            tiles wrote; the pixels that are retired then are written there.
    """
    columns = -(-film.pixels.shape[1] // TILE)
    few = min(FIRST, style.samples)
    skipped = style.samples - few  # samples of a retired pixel
    for tile in range(span[0], span[1]):
        left = tile % columns * TILE
        top = tile // columns * TILE
        size = min(TILE, film.pixels.shape[1] - left), min(TILE, film.pixels.shape[0] - top)
        clear(scratch.sums, scratch.cells)
        if reopened_only:
            load_edges(film.edges, tile, columns, scratch.cells, scratch.retired)
        else:
            for p in range(TILE * TILE):
                scratch.retired[p] = p & LAST < size[0] and p >> BITS < size[1]
            pending = list_retired(scratch, False)
            sample_pixels(scene, view, style, film, scratch, (left, top), pending, (0, few))
            scratch.counts[RETIRED] += pending * skipped

        # all samples of the pixels about which those so far disagree, until they disagree about no other
        pending = list_retired(scratch, True) if skipped > 0 else 0
        while pending > 0:
            for k in range(pending):
                scratch.retired[scratch.todo[k]] = False
            samples = 0 if reopened_only else few, style.samples
            sample_pixels(scene, view, style, film, scratch, (left, top), pending, samples)
            write_means(style, film, scratch, (left, top), pending)
            scratch.counts[RETIRED] -= pending * skipped
            pending = list_retired(scratch, True)

        if reopened_only:
            store_retired(film.edges[tile], scratch.retired)
            continue
        write_means(style, film, scratch, (left, top), list_retired(scratch, False))
        if skipped > 0:
            store_edges(film.edges[tile], scratch.cells, scratch.retired)


@kernel
def mark_reopened(film: Film, scratch: Scratch, marks: Bools) -> None:
    """Mark the tiles of which `render_tiles` would render some pixels again: `marks`, bool (tiles,)."""
    for tile in range(len(film.edges)):
        clear(scratch.sums, scratch.cells)
        load_edges(film.edges, tile, -(-film.pixels.shape[1] // TILE), scratch.cells, scratch.retired)
        marks[tile] = list_retired(scratch, True) > 0


@inline
def list_retired(scratch, reopened):
    """List a tile's retired pixels as `todo`, `reopened` those about which samples disagree; returns how many."""
    left = 0
    for k in range(TILE * TILE):
        p = scratch.order[k]
        scratch.todo[left] = p
        left += scratch.retired[p] and not (reopened and converged(scratch.cells, p))
    return left


@inline
def sample_pixels(scene, view, style, film, scratch, tile_corner, pending, samples):
    """Add the samples [first, end) of the pixels on the list `todo` to their sums and cells, a few at a time.

    Args: tile_corner: its left column and top row on the film.
    """
    points = scratch.layers if scene.geometry.layered else scratch.points
    corner = film.left + tile_corner[0], film.top + tile_corner[1]
    for done in range(samples[0], samples[1], FIRST):
        batch = min(FIRST, samples[1] - done)
        of_packet = WIDE // batch  # pixels a packet, all samples of a pixel on end
        packets = -(-pending // of_packet)
        trace_samples(scene, view, style, scratch, corner, (pending, packets), (done, batch))
        if style.samples > 1:
            for e in range(packets):
                pixels = scratch.todo[e * of_packet : min((e + 1) * of_packet, pending)]
                accumulate(points[e], scratch.sums, pixels, batch, style.layers)
                widen(points[e], scratch.cells, pixels, view, corner, (done, batch))


@inline
def write_means(style, film, scratch, tile_corner, pending):
    """Write the means of the pixels on the list `todo` to the film."""
    points = scratch.points if len(scratch.layers) == 0 else scratch.layers
    for k in range(0, pending, WIDE):
        packet = points[k // WIDE]  # with one sample a pixel, its lanes are the pixels
        if style.samples > 1:
            mean(scratch.sums, scratch.todo[k : min(k + WIDE, pending)], style.layers, packet)
        write_pixels(
            packet,
            load_row(scratch.todo, k // WIDE),
            lane_numbers() < pending - k,
            film,
            tile_corner[0],
            tile_corner[1],
        )


@inline
def trace_samples(scene, view, style, scratch, corner, work, samples):
    """Trace and light samples of the pixels on the list `todo`, surface by surface from front to back.

    Args: work: number of pixels, and of packets for them. samples: the first, and how many of each pixel.
    """
    pending, packets = work
    done, batch = samples
    of_packet = WIDE // batch
    layered = scene.geometry.layered
    traced = packets
    extended = False  # whether some light is more than a point
    for light in scene.lights.parameters:
        extended |= light[RADIUS] > 0.0
    if layered:
        begin_layers(scratch, packets)
    while traced > 0:  # once, where all surfaces are opaque
        for e in range(traced):
            numbers = lane_numbers() + e * WIDE  # of viewing rays, −1 for none
            if layered:
                numbers = load_row(scratch.active_rays, e)
            # The pixel and the sample of each ray.
            turn = ((numbers & (WIDE - 1)) * (256 // batch + 1)) >> 8  # number // batch, in a packet
            row = turn + (numbers >> 4) * of_packet  # of the pixel on the list
            active = (numbers >= 0) & (turn < of_packet) & (row < pending)
            pixels = gather(scratch.todo, select(active, row, 0))
            sample = (numbers & (WIDE - 1)) - turn * batch + done
            x = (pixels & LAST) + corner[0]
            y = (pixels >> BITS) + corner[1]
            # The rays, and what they hit.
            start = aim(scratch.rays, view, x, y, select(active, sample, 0), scene.geometry.farthest)
            if layered:  # rays start behind the layers that they have seen
                for lane in range(WIDE):
                    ray = max(pick(numbers, lane), 0)
                    scratch.rays[TNEAR, lane] = scratch.layers[ray // WIDE, BEGIN, ray % WIDE]
            items = trace_packet(scene, view, style, scratch, e, start, active)
            store_row(scratch.items, e, items)
            if extended:
                write_discs(scratch.points[e], view, x, y, select(active, sample, 0))
            scratch.counts[PRIMARY] += count(active)
            scratch.counts[BACKGROUND] += count(active & (items < 0)) * len(scene.lights.kinds)
        if style.shading != GOURAUD:
            light_packets(scene.geometry, scene.lights, style, scratch, traced)
        traced = composite(scratch, traced, style.layers) if layered else 0


@inline
def trace_packet(scene, view, style, scratch, e, start, active):
    """Trace the viewing rays `scratch.rays` in the lanes of `active`, `start` from the viewer; the hits become
    packet e.

    Returns the rows of the objects hit, −1 for none.
    """
    geometry = scene.geometry
    rays = scratch.rays
    packet = scratch.points[e]
    items, faces, u, v, distance = closest_hits(geometry, rays, scratch.valid, active)
    if geometry.layered:  # where the rays would go on, and the alpha of what they hit
        store_row(scratch.layers[e], NEXT, distance + STEP)
        store_row(scratch.layers[e], COVER, load_row(rays, MET_ALPHA))
    # What a ray that hits nothing leaves: the background, fully lit.
    for column in range(layout.BEAUTY, layout.FILM if style.layers else layout.W):
        store_row(packet, column, 1.0 if layout.W <= column <= layout.SHADOW else 0.0)
    for c in range(3):
        store_row(packet, layout.EMISSION + c, style.background[c])
    store_row(packet, layout.UNSHADOWED, 0.0)
    store_row(packet, layout.SHADOWED, 0.0)
    # The hits, object by object.
    left = items >= 0
    depth = start + distance
    hits = PacketHits(faces, u, v, depth, scale(-1.0, load3(rays, DIR_X)))
    if style.layers:
        store_row(packet, layout.DEPTH, select(left, depth, np.inf))
        store_row(packet, layout.ID, single(double(items + 1)))
    while some(left):
        item, mask = next_object(items, left)
        face_normal = write_hits(packet, scene, item, mask, hits, view, style)
        if len(geometry.polygons) > 0:
            write_polygons(packet, geometry, item, mask, hits, view, style, face_normal)
        map_albedo(packet, scene, item, mask, hits, view, scratch.missing)
        map_grain(packet, scene, item, mask, hits, view, scratch.missing)
        if style.weighted:
            map_occlusion(packet, scene, item, mask, hits, view, scratch.missing)
        material = geometry.materials[item]
        store1(packet, layout.ALPHA, mask, material[ALPHA])
        if style.layers:
            store3(packet, layout.ALBEDO, mask, multiply(load3(packet, layout.ALBEDO_MAP), triple(material, MODEL)))
        if style.shading == GOURAUD:
            interpolate_lit(packet, scene, item, mask, hits, style, face_normal)
        left = left & ~mask
    return items
