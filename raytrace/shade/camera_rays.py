"""Viewing rays: a camera in render space, and its packets of sixteen rays."""

from typing import NamedTuple

import numpy as np

from ..camera import Camera
from ..embree import DIR_X, ORG_X, TFAR, TNEAR
from ..kernel.jit import inline
from ..kernel.simd import WIDE, double, pick, replace, single, store_row
from ..kernel.vector import add, dot, scale, triple, unit
from ..sampling import hash32, hash32_array, owen_sobol, seed_key, shuffled_owen_sobol
from ..settings import Settings
from ..types import Float64Grid, Float64s
from .layout import DISC

_SETS = 256
_CENTRE = np.empty((0, 6, 1))  # no sets of places: every ray goes through its pixel's centre


class View(NamedTuple):
    """A camera in render space, and where in a pixel its samples fall."""

    eye: Float64s
    right: Float64s
    up: Float64s
    forward: Float64s
    half: float  # tangent of half the vertical angle, or half the height of an orthographic view
    orthographic: bool
    lens: float  # radius
    focus: float  # distance of what is sharp
    width: int  # of the whole picture
    height: int
    offsets: Float64Grid  # (sets, 6, samples), from the pixel's centre, on the unit lens and on lights; no sets: all 0
    key: np.uint32


def place_camera(camera: Camera, settings: Settings, centre: Float64s, scale: float) -> View:
    """A camera as kernels take it, in a render space where points p stand at (p − centre) · scale."""
    right, up, forward = camera.axes()
    position = np.array(camera.position)
    distance = camera.focus or float(np.linalg.norm(np.subtract(camera.target, position)))
    perspective = float(np.tan(np.radians(camera.field_of_view / 2)))
    return View(
        eye=(position - centre) * scale,
        right=right,
        up=up,
        forward=forward,
        half=perspective if camera.height is None else camera.height / 2 * scale,
        orthographic=camera.height is not None,
        lens=camera.aperture / 2 * scale,
        focus=distance * scale,
        width=settings.width,
        height=settings.height,
        offsets=_offsets(settings.samples, settings.seed) if settings.samples > 1 or camera.aperture else _CENTRE,
        key=seed_key(settings.seed),
    )


def _offsets(samples: int, seed: int) -> Float64s:
    """Places (sets, 6, samples) under a tent filter of radius 1 pixel; on the lens; and on the discs of lights.

    One sample is in the pixel's centre, and in the lights'.
    """
    key = seed_key(seed)
    uniform = np.stack(owen_sobol(_SETS, samples, key), axis=1)
    xy = np.where(uniform < 0.5, np.sqrt(2 * uniform) - 1, 1 - np.sqrt(2 - 2 * uniform))  # density 1 − |x| on (−1, 1)
    lens = _on_disc(samples, key ^ np.uint32(0x5BD1E995))
    lights = _on_disc(samples, key ^ np.uint32(0x9E3779B9))
    if samples == 1:
        xy = np.zeros_like(xy)
        lights = np.zeros_like(lights)
    return np.concatenate([xy, lens, lights], axis=1)


def _on_disc(samples: int, key: np.uint32) -> Float64s:
    """Places (sets, 2, samples) on the unit disc."""
    u, v = shuffled_owen_sobol(_SETS, samples, hash32_array([key])[0])
    radius = np.sqrt(u)
    angle = 2 * np.pi * v
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


@inline
def pixel_width(view, depth):
    """Width of a pixel at a distance from the viewer."""
    width = 2.0 * view.half / view.height
    return width * (0.0 * depth + 1.0 if view.orthographic else depth)


@inline
def offset_set(view, x, y):
    """The row of `offsets` that a pixel of the whole picture takes, by its hash."""
    return hash32(hash32(y * view.width + x) ^ view.key) % np.uint32(len(view.offsets))


@inline
def write_discs(packet, view, x, y, samples):
    """Write where on lights the samples of sixteen pixels are. Args: as `aim`."""
    for lane in range(WIDE):
        for axis in range(2):
            packet[DISC + axis, lane] = 0.0
            if len(view.offsets) > 0:
                k = offset_set(view, pick(x, lane), pick(y, lane))
                packet[DISC + axis, lane] = view.offsets[k, 4 + axis, pick(samples, lane)]


@inline
def aim(rays, view, x, y, samples, farthest):
    """Make `rays` the viewing rays of sixteen pixels (x, y) of the whole picture, and of the samples of these numbers,
    int32 lanes; returns how far from the viewer they start, float32."""
    film_x = double(x) + 0.5
    film_y = double(y) + 0.5
    lens_x = 0.0 * film_x
    lens_y = 0.0 * film_x
    offsets = view.offsets

    # places in the pixel and on the lens, by a hash of the pixel
    if len(offsets) > 0:
        for lane in range(WIDE):
            sample = pick(samples, lane)
            k = offset_set(view, pick(x, lane), pick(y, lane))
            film_x = replace(film_x, lane, pick(film_x, lane) + offsets[k, 0, sample])
            film_y = replace(film_y, lane, pick(film_y, lane) + offsets[k, 1, sample])
            lens_x = replace(lens_x, lane, offsets[k, 2, sample])
            lens_y = replace(lens_y, lane, offsets[k, 3, sample])
    right = triple(view.right, 0)
    up = triple(view.up, 0)
    forward = triple(view.forward, 0)

    # from the film through the lens
    a = (2.0 * film_x - view.width) * (view.half / view.height)
    b = (view.height - 2.0 * film_y) * (view.half / view.height)
    across = add(scale(a, right), scale(b, up))
    if view.orthographic:
        shift, direction = across, add(scale(0.0, across), forward)
    else:
        shift = scale(0.0, across)
        direction = unit(add(forward, across))
        if view.lens > 0.0:
            sharp = scale(view.focus / dot(direction, forward), direction)
            shift = add(scale(view.lens * lens_x, right), scale(view.lens * lens_y, up))
            direction = unit(add(sharp, scale(-1.0, shift)))

    origin = add(triple(view.eye, 0), shift)
    # the scene lies within a quarter of `farthest` of the origin of render space
    start = max(0.0, -0.25 * farthest - dot(origin, direction))
    near = add(origin, scale(start, direction))
    for axis in range(3):
        store_row(rays, ORG_X + axis, single(near[axis]))
        store_row(rays, DIR_X + axis, single(direction[axis]))
    store_row(rays, TNEAR, 0.0)
    store_row(rays, TFAR, farthest)
    return single(start)
