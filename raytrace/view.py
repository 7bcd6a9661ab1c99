"""Viewing rays: a camera in the world's own units, and its packets."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from .chance import mix
from .embree import DIR_X, GEOM_ID, INST_ID, INVALID, LANES, ORG_X, PRIM_ID, TFAR, intersect8
from .jit import inline, kernel
from .vector import add, dot, scale, unit

FARTHEST = 8.0  # longer than anything in the world


class View(NamedTuple):
    """A camera in the world's own units, and where in a pixel its samples fall.

    Attributes:
        eye, right, above, forward: float64 (3,). half: tangent of half the vertical angle, or half the height of an
        orthographic view; orthographic: whether. lens: radius; focus: distance of what is sharp. width, height: of the
        whole picture. offsets: float64 (sets, 4, samples), place in the pixel, from its centre, and on the unit lens.
        key: uint32.
    """

    eye: npt.NDArray[np.float64]
    right: npt.NDArray[np.float64]
    above: npt.NDArray[np.float64]
    forward: npt.NDArray[np.float64]
    half: float
    orthographic: bool
    lens: float
    focus: float
    width: int
    height: int
    offsets: npt.NDArray[np.float64]
    key: Any


@inline
def viewing_ray(view, x, y, lens_x, lens_y):
    """Origin and unit direction through the film point (x, y) in pixels from the upper left."""
    right, above, forward = load3(view.right), load3(view.above), load3(view.forward)
    a = view.half * (2.0 * x - view.width) / view.height
    b = view.half * (1.0 - 2.0 * y / view.height)
    across = add(scale(a, right), scale(b, above))
    eye = load3(view.eye)
    if view.orthographic:
        return add(eye, across), forward
    direction = unit(add(forward, across))
    if view.lens > 0.0:
        sharp = scale(view.focus / dot(direction, forward), direction)
        shift = add(scale(view.lens * lens_x, right), scale(view.lens * lens_y, above))
        return add(eye, shift), unit(add(sharp, scale(-1.0, shift)))
    return eye, direction


@inline
def load3(a):
    """A (3,) array as a triple."""
    return a[0], a[1], a[2]


@inline
def pixel_width(view, depth):
    """Width of a pixel at a distance from the viewer."""
    width = 2.0 * view.half / view.height
    return width if view.orthographic else width * depth


@inline
def approach(origin, direction):
    """How far a ray can go before it comes near the world, which lies within 2 of the centre."""
    return max(0.0, -dot(origin, direction) - 2.0)


@inline
def aim(packet, lane, view, x, y, sample):
    """Put a pixel's viewing ray into a lane; returns how far from the viewer it starts."""
    k = mix(mix(y * view.width + x) ^ view.key) % np.uint32(len(view.offsets))
    offsets = view.offsets
    origin, direction = viewing_ray(
        view,
        x + 0.5 + offsets[k, 0, sample],
        y + 0.5 + offsets[k, 1, sample],
        offsets[k, 2, sample],
        offsets[k, 3, sample],
    )
    start = approach(origin, direction)
    near = add(origin, scale(start, direction))
    for axis in range(3):
        packet[ORG_X + axis, lane] = near[axis]
        packet[DIR_X + axis, lane] = direction[axis]
    packet[TFAR, lane] = FARTHEST
    return start


@inline
def struck(ids, lane):
    """Row of the object and of the face that a lane has hit."""
    outer = ids[INST_ID, lane]
    item = ids[GEOM_ID, lane] if outer == INVALID else outer
    return int(item), int(ids[PRIM_ID, lane])


@kernel
def mark_seen(geometry, view, left, right, first, last, packet, valid, seen):
    """Set `seen`, bool (w,), for the vertices of all faces that a sample of the rows [first, last) meets."""
    ids = packet.view(np.uint32)
    samples = view.offsets.shape[2]
    total = (right - left) * samples
    for y in range(first, last):
        for start in range(0, total, LANES):
            lanes = min(LANES, total - start)
            for lane in range(LANES):
                valid[lane] = -1 if lane < lanes else 0
            for lane in range(lanes):
                aim(packet, lane, view, left + (start + lane) // samples, y, (start + lane) % samples)
            intersect8(geometry.handle, packet, valid)
            for lane in range(lanes):
                if ids[GEOM_ID, lane] != INVALID:
                    item, face = struck(ids, lane)
                    own = geometry.first_w[item] - geometry.first_vertex[item]
                    for corner in range(3):
                        seen[own + geometry.faces[geometry.first_face[item] + face, corner]] = True
