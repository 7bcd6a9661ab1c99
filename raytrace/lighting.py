"""The sum over lights (12.75): ambient, diffuse and specular light of many points, a shadow ray only where one matters.

I(p) = I_e + k_a I_a·w + Σ_j δ(p, j) I_L(j) (diffuse_j + specular_j); the book's form weights diffuse light by w too.
"""

from __future__ import annotations

import numpy as np

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
from .lights import AMBIENT as AMBIENT_LIGHT
from .models.dispatch import ambient, emission, terms
from .surface import put, take
from .vector import add, dot
from .view import FARTHEST

OFF, AMBIENT_ONLY, BOOK = range(3)
PRIMARY, SHADOW, BACKGROUND, BEHIND, UNREACHED, BLACK, CULLED, RETIRED = range(8)
COUNTERS = 8
SHORT = 1.0 - 1e-5  # of the way to a light: what touches the light itself is no obstacle


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
def flush(geometry, entries, queue, light, waiting, packet, valid):
    """Trace the first `waiting` queued shadow rays and add what arrives; returns how many were traced."""
    for lane in range(LANES):
        valid[lane] = -1 if lane < waiting else 0
    occluded8(geometry.handle, packet, valid)
    for lane in range(waiting):
        if packet[TFAR, lane] >= 0.0:
            add_light(entries[queue[lane]], light[lane])
    return waiting


@inline
def add_light(entry, light):
    """Add a light's diffuse and specular RGB, and its share of what got through."""
    for c in range(3):
        entry[DIFFUSE + c] += light[c]
        entry[SPECULAR + c] += light[3 + c]
        entry[LIT] += light[c] + light[3 + c]


@inline
def light_entries(geometry, lights, entries, count, active, form, shadows, packet, valid, queue, light, counts):
    """Light the first `count` entries.

    Args: active: scratch int64 (lights,); queue: scratch int64 (8,); light: scratch float64 (8, 6); counts: int64
        (COUNTERS,), added to.
    """
    total = ambient_light(lights)
    for e in range(count):
        begin(entries[e], geometry, total, form)
    used = select_lights(lights, entries, count, active)
    counts[CULLED] += (count_directed(lights) - used) * count
    for a in range(used):
        j = active[a]
        kind, light_row = lights.kinds[j], lights.rows[j]
        waiting = 0
        for e in range(count):
            entry = entries[e]
            n = take(entry, NORMAL)
            l, distance, arriving = incident(kind, light_row, take(entry, POINT))
            if entry[FRONT] == 0.0 or dot(n, l) <= 0.0:
                counts[BEHIND] += 1
                continue
            if arriving[0] + arriving[1] + arriving[2] == 0.0:
                counts[UNREACHED] += 1
                continue
            item = int(entry[OBJECT])
            diffuse, specular = terms(
                geometry.kinds[item], geometry.rows[item], n, l, take(entry, VIEW), take(entry, GRAIN)
            )
            w = entry[W] if form == BOOK else 1.0
            sent = 0.0
            for c in range(3):
                light[waiting, c] = arriving[c] * diffuse[c] * entry[TINT + c] * w
                light[waiting, 3 + c] = arriving[c] * specular[c]
                sent += light[waiting, c] + light[waiting, 3 + c]
            if sent == 0.0:
                counts[BLACK] += 1
                continue
            entry[SENT] += sent
            if not shadows:
                add_light(entry, light[waiting])
                continue
            for axis in range(3):
                packet[ORG_X + axis, waiting] = entry[ORIGIN + axis]
                packet[DIR_X + axis, waiting] = l[axis]
            packet[TFAR, waiting] = min(distance * SHORT, FARTHEST)
            queue[waiting] = e
            waiting += 1
            if waiting == LANES:
                counts[SHADOW] += flush(geometry, entries, queue, light, waiting, packet, valid)
                waiting = 0
        if waiting > 0:
            counts[SHADOW] += flush(geometry, entries, queue, light, waiting, packet, valid)
