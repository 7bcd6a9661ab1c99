"""The sum over lights (12.75): ambient, diffuse and specular light of many points, a shadow ray only where one matters.

I(p) = I_e + k_a I_a·w + Σ_j δ(p, j) I_L(j) (diffuse_j + specular_j); the book's form weights diffuse light by w too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .embree import DIR_X, LANES, ORG_X, TFAR, occluded8
from .entries import (
    AMBIENT,
    DIFFUSE,
    EMISSION,
    FRONT,
    GRAIN,
    LIT,
    NORMAL,
    OBJECT,
    ORIGIN,
    POINT,
    SENT,
    SPECULAR,
    TINT,
    VIEW,
    W,
)
from .jit import inline
from .light_kernels import cannot_matter_in, incident
from .light_rows import AMBIENT as AMBIENT_LIGHT
from .models.dispatch import ambient, emission, terms
from .surface import put, take
from .vector import add, dot
from .view import FARTHEST

OFF, AMBIENT_ONLY, BOOK = range(3)
PRIMARY, SHADOW, BACKGROUND, BEHIND, UNREACHED, BLACK, CULLED, RETIRED = range(8)
COUNTERS = 8
SHORT = 1.0 - 1e-5  # of the way to a light: what touches the light itself is no obstacle


class Style(NamedTuple):
    """How a picture is made, for kernels.

    Attributes:
        samples: most a pixel. shading, form: numbers of the interpolation and of the obscurance form. shadows,
        terminator: whether. background: linear RGB.
    """

    samples: int
    shading: int
    form: int
    shadows: bool
    terminator: bool
    background: tuple[float, float, float]


class Scratch(NamedTuple):
    """One thread's working memory.

    Attributes:
        packet, valid: rays (`raytrace.embree.new_packet`); ID holds how far from the viewer a viewing ray starts.
        entries: float64 (k, entries.WIDTH), points to be lit. sums: float64 (pixels, …), a tile's film.
        todo: int64 (pixels,), pixels that want more samples. active: int64 (lights,), lights that can matter.
        queue: int64 (8,), entries whose shadow rays wait; arriving: float64 (8, 6), the diffuse and specular RGB that
        they would let through. counts: int64 (COUNTERS,).
    """

    packet: npt.NDArray[np.float32]
    valid: npt.NDArray[np.int32]
    entries: npt.NDArray[np.float64]
    sums: npt.NDArray[np.float64]
    todo: npt.NDArray[np.int64]
    active: npt.NDArray[np.int64]
    queue: npt.NDArray[np.int64]
    arriving: npt.NDArray[np.float64]
    counts: npt.NDArray[np.int64]


@inline
def ambient_light(lights):
    """I_a: the sum of all ambient lights."""
    total = (0.0, 0.0, 0.0)
    for j in range(len(lights.kinds)):
        if lights.kinds[j] == AMBIENT_LIGHT:
            _, _, arriving = incident(AMBIENT_LIGHT, lights.rows[j], total)
            total = add(total, arriving)
    return total


@inline
def begin(entry, geometry, total, form):
    """Emission and reflected ambient light of an entry; diffuse and specular light start at zero."""
    material = geometry.rows[int(entry[OBJECT])]
    k_a = ambient(material)
    w = 1.0 if form == OFF else entry[W]
    for c in range(3):
        entry[AMBIENT + c] = k_a[c] * total[c] * entry[TINT + c] * w
        entry[DIFFUSE + c] = 0.0
        entry[SPECULAR + c] = 0.0
    put(entry, EMISSION, emission(material))
    entry[SENT] = 0.0
    entry[LIT] = 0.0


@inline
def count_directed(lights):
    """How many lights come from somewhere, ambient ones left out."""
    found = 0
    for j in range(len(lights.kinds)):
        found += lights.kinds[j] != AMBIENT_LIGHT
    return found


@inline
def select_lights(lights, entries, count, active):
    """Fill `active` with the lights that can matter to some of the first `count` entries, and return how many."""
    low, high = (np.inf, np.inf, np.inf), (-np.inf, -np.inf, -np.inf)
    for e in range(count):
        p = take(entries[e], POINT)
        low = (min(low[0], p[0]), min(low[1], p[1]), min(low[2], p[2]))
        high = (max(high[0], p[0]), max(high[1], p[1]), max(high[2], p[2]))
    used = 0
    for j in range(len(lights.kinds)):
        kind = lights.kinds[j]
        if kind == AMBIENT_LIGHT or cannot_matter_in(kind, lights.rows[j], low, high, (0.0, 0.0, 1.0), np.pi, 0.0):
            continue
        active[used] = j
        used += 1
    return used


@inline
def flush(geometry, scratch, waiting):
    """Trace the first `waiting` queued shadow rays and add what arrives."""
    for lane in range(LANES):
        scratch.valid[lane] = -1 if lane < waiting else 0
    occluded8(geometry.handle, scratch.packet, scratch.valid)
    for lane in range(waiting):
        if scratch.packet[TFAR, lane] >= 0.0:
            add_light(scratch.entries[scratch.queue[lane]], scratch.arriving[lane])
    scratch.counts[SHADOW] += waiting


@inline
def add_light(entry, arriving):
    """Add a light's diffuse and specular RGB, and its share of what got through."""
    for c in range(3):
        entry[DIFFUSE + c] += arriving[c]
        entry[SPECULAR + c] += arriving[3 + c]
        entry[LIT] += arriving[c] + arriving[3 + c]


@inline
def light_entries(geometry, lights, style, scratch, count):
    """Light the first `count` entries of `scratch`."""
    entries, packet, counts = scratch.entries, scratch.packet, scratch.counts
    total = ambient_light(lights)
    for e in range(count):
        begin(entries[e], geometry, total, style.form)
    used = select_lights(lights, entries, count, scratch.active)
    counts[CULLED] += (count_directed(lights) - used) * count
    for a in range(used):
        j = scratch.active[a]
        waiting = 0
        for e in range(count):
            entry = entries[e]
            distance = reflect_light(entry, geometry, lights.kinds[j], lights.rows[j], style, scratch, waiting)
            if distance < 0.0:
                continue
            if not style.shadows:
                add_light(entry, scratch.arriving[waiting])
                continue
            for axis in range(3):
                packet[ORG_X + axis, waiting] = entry[ORIGIN + axis]
            packet[TFAR, waiting] = min(distance * SHORT, FARTHEST)
            scratch.queue[waiting] = e
            waiting += 1
            if waiting == LANES:
                flush(geometry, scratch, waiting)
                waiting = 0
        if waiting > 0:
            flush(geometry, scratch, waiting)


@inline
def reflect_light(entry, geometry, kind, light, style, scratch, lane):
    """Diffuse and specular RGB of one light before its shadow, into `lane` of `scratch.arriving`, with the direction.

    Returns how far the light is, or −1 if it brings nothing, which is counted.
    """
    n = take(entry, NORMAL)
    l, distance, intensity = incident(kind, light, take(entry, POINT))
    if entry[FRONT] == 0.0 or dot(n, l) <= 0.0:
        scratch.counts[BEHIND] += 1
        return -1.0
    if intensity[0] + intensity[1] + intensity[2] == 0.0:
        scratch.counts[UNREACHED] += 1
        return -1.0
    item = int(entry[OBJECT])
    diffuse, specular = terms(geometry.kinds[item], geometry.rows[item], n, l, take(entry, VIEW), take(entry, GRAIN))
    w = entry[W] if style.form == BOOK else 1.0
    sent = 0.0
    for c in range(3):
        scratch.arriving[lane, c] = intensity[c] * diffuse[c] * entry[TINT + c] * w
        scratch.arriving[lane, 3 + c] = intensity[c] * specular[c]
        sent += scratch.arriving[lane, c] + scratch.arriving[lane, 3 + c]
    if sent == 0.0:
        scratch.counts[BLACK] += 1
        return -1.0
    entry[SENT] += sent
    for axis in range(3):
        scratch.packet[DIR_X + axis, lane] = l[axis]
    return distance
