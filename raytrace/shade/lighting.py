"""The sum over lights (12.75): ambient, diffuse and specular light of many points, a shadow ray only where one matters.

I(p) = I_e + k_a I_a·w + Σ_j δ(p, j) I_L(j) (diffuse_j + specular_j); the book's form weights diffuse light by w too.

Of a sky or an image: k_a I_a(b) w, I_a the mean light of the hemisphere about the bent normal b. Of it the part that
the material's highlight would reflect, F ≤ k_a, is F (V L + (1 − V) I_a(b) w): L comes from the mirror direction,
blurred as the material is rough, and V is the part of that which is open
(`raytrace.lights.environment.cone_visibility`).
"""

from math import acos

import numpy as np

from ..brdf.dispatch import terms_in_lanes
from ..brdf.material import AMBIENT, EMISSION, GLOSS, GRAZING, SLOPE
from ..brdf.microfacet import fifth
from ..kernel.jit import inline
from ..kernel.simd import WIDE, count, highest, lane_numbers, load_row, lowest, pick, select, some, store_row
from ..kernel.vector import add, choose, dot, mirror, multiply, scale, subtract, triple, unit
from ..lights.environment import cone_visibility, harmonic_irradiance, map_radiance, sky_irradiance, sky_radiance
from ..lights.kernels import DIFFUSE, RADIUS, SPECULAR, cannot_matter_in, incident, towards, towards_disc
from . import layout
from .interaction import CONSTANT, FLAT, next_object
from .layout import BEHIND, BLACK, BOOK, CULLED, OFF, UNOBSTRUCTED, UNREACHED, load3, store3
from .shaft_culling import obstructed
from .transparency import transmittance

DARK = (0.0, 0.0, 0.0)


@inline
def lane_triple(packet, column, lane):
    """Three columns of one lane, from `column` on, in double precision."""
    x = packet[column, lane]
    y = packet[column + 1, lane]
    z = packet[column + 2, lane]
    return np.float64(x), np.float64(y), np.float64(z)


@inline
def reflect_environment(packet, lane, row, lights, style):
    """Write the ambient light that a point reflects, of ambient lights and of the environment."""
    # The normal, w and the bent normal.
    n = lane_triple(packet, layout.NORMAL, lane)
    v = lane_triple(packet, layout.VIEW, lane)
    w = 1.0
    bent = n
    if style.form != OFF:
        w = np.float64(packet[layout.W, lane])
        bent = unit(lane_triple(packet, layout.BENT, lane))
        if dot(bent, n) <= 0.0:  # no bent normal is known, or the surface is seen from behind
            bent = n
    # What arrives from all sides.
    arriving = triple(lights.ambient, 0)  # I_a about the bent normal
    reflectance = triple(row, AMBIENT)
    for sky in lights.skies:
        arriving = add(arriving, sky_irradiance(sky, bent))
    if len(lights.harmonics) > 0:
        arriving = add(arriving, harmonic_irradiance(lights.harmonics, bent))

    # the part that the highlight mirrors
    slope = row[SLOPE]
    gloss = triple(row, GLOSS)
    grazing = triple(row, GRAZING)
    mirrored = triple(lights.ambient, 0)
    visible = 0.0
    rise = 0.0
    glossy = style.shading != CONSTANT and max(grazing[0], grazing[1], grazing[2]) > 0.0
    if glossy:
        r = mirror(n, v)
        for sky in lights.skies:
            mirrored = add(mirrored, sky_radiance(sky, r, slope))
        if len(lights.harmonics) > 0:
            mirrored = add(mirrored, map_radiance(lights.maps, lights.frame, r, slope))
        visible = cone_visibility(w, acos(max(-1.0, min(1.0, dot(bent, r)))), slope)
        rise = fifth(1.0 - max(0.0, min(1.0, dot(n, v))))

    for c in range(3):  # in single precision, as ambient light alone is reflected
        share = np.float32(reflectance[c]) * packet[layout.ALBEDO_MAP + c, lane]
        value = np.float32(reflectance[c] * arriving[c]) * packet[layout.ALBEDO_MAP + c, lane]
        if style.form != OFF:
            value = np.float32(w) * value
        if glossy:
            part = min(np.float64(share), gloss[c] + (grazing[c] - gloss[c]) * rise)
            value = np.float32(max(0.0, value + part * visible * (mirrored[c] - arriving[c] * w)))
        packet[layout.AMBIENT + c, lane] = value


@inline
def add_undirected(packet, items, geometry, ambient, form):
    """Write emission and reflected ambient light, which have no direction."""
    left = items >= 0
    albedo = load3(packet, layout.ALBEDO_MAP)
    w = load_row(packet, layout.W)
    while some(left):
        item, mask = next_object(items, left)
        material = geometry.materials[item]
        reflected = multiply(multiply(triple(material, AMBIENT), triple(ambient, 0)), albedo)
        if form != OFF:
            reflected = scale(w, reflected)
        store3(packet, layout.AMBIENT, mask, reflected)
        store3(packet, layout.EMISSION, mask, triple(material, EMISSION))
        left = left & ~mask


@inline
def extended(box, mask, p):
    """Low and high corners of a box, lanes, extended by the points p in the lanes of `mask`."""
    low, high = box
    end = np.float32(np.inf)
    a = choose(mask, p, (end, end, end))
    b = choose(mask, p, (-end, -end, -end))
    lowest_yet = min(low[0], a[0]), min(low[1], a[1]), min(low[2], a[2])
    return lowest_yet, (max(high[0], b[0]), max(high[1], b[1]), max(high[2], b[2]))


@inline
def corners(box):
    """Low and high corner of a box whose corners are lanes."""
    low, high = box
    first_corner = lowest(low[0]), lowest(low[1]), lowest(low[2])
    return first_corner, (highest(high[0]), highest(high[1]), highest(high[2]))


@inline
def select_lights(geometry, lights, shading, scratch, packets):
    """Fill `active` and `hidden` of `scratch` with the lights that can matter to a point of some packets; returns
    how many do."""
    nowhere = select(lane_numbers() < 0, 0.0, np.inf)
    empty = (nowhere, nowhere, nowhere), scale(-1.0, (nowhere, nowhere, nowhere))

    # boxes around the points, their ray origins and the ways between these
    points = empty
    origins = empty
    shifts = empty
    for e in range(packets):
        occupied = load_row(scratch.items, e) >= 0
        point = load3(scratch.points[e], layout.POINT)
        origin = load3(scratch.points[e], layout.ORIGIN)
        points = extended(points, occupied, point)
        origins = extended(origins, occupied, origin)
        shifts = extended(shifts, occupied, subtract(origin, point))
        two_sided = occupied & (load_row(scratch.points[e], layout.FRONT) > layout.ON_THIS_SIDE)
        if some(two_sided):
            back = load3(scratch.points[e], layout.BACK)
            origins = extended(origins, two_sided, back)
            shifts = extended(shifts, two_sided, subtract(back, point))
    low, high = corners(points)
    start = corners(origins)
    shift = corners(shifts)
    if shading in (CONSTANT, FLAT):  # shadow rays end at the light itself
        shift = scale(np.float32(0.0), shift[0]), scale(np.float32(0.0), shift[1])

    used = 0
    for j in range(len(lights.kinds)):
        kind = lights.kinds[j]
        row = lights.parameters[j]
        if not cannot_matter_in(kind, row, low, high):
            scratch.active[used] = j
            scratch.hidden[used] = obstructed(geometry.boxes, geometry.farthest, start, shift, kind, row)
            used += 1
    return used


@inline
def light_packets(geometry, lights, style, scratch, packets):
    """Write the light that the first packets of `scratch.points` reflect."""
    points = 0
    for e in range(packets):
        items = load_row(scratch.items, e)
        add_undirected(scratch.points[e], items, geometry, lights.ambient, style.form)
        if len(lights.skies) + len(lights.harmonics) > 0:
            for lane in range(WIDE):
                if pick(items, lane) >= 0:
                    reflect_environment(scratch.points[e], lane, geometry.materials[pick(items, lane)], lights, style)
        points += count(items >= 0)
    used = select_lights(geometry, lights, style.shading, scratch, packets) if points > 0 else 0
    scratch.counts[CULLED] += (len(lights.kinds) - used) * points
    for e in range(packets):
        items = load_row(scratch.items, e)
        if some(items >= 0):
            light_packet(scratch.points[e], items, used, geometry, lights, style, scratch)


@inline
def light_packet(packet, items, used, geometry, lights, style, scratch):
    """Add up the first `used` active lights of sixteen points."""
    counts = scratch.counts
    point = load3(packet, layout.POINT)
    n = load3(packet, layout.NORMAL)
    occupied = items >= 0
    seen = occupied & (load_row(packet, layout.FRONT) > 0.0)
    two_sided = occupied & (load_row(packet, layout.FRONT) > layout.ON_THIS_SIDE)
    zero = scale(0.0, point)
    sums = zero, zero, zero[0], zero[0]  # diffuse and specular light, and brightness without and with shadows
    for a in range(used):
        j = scratch.active[a]
        l, distance, intensity = incident(lights.kinds[j], lights.parameters[j], point)

        # the side that the light falls on, and the points that it reaches
        side, origin = facing_side(packet, n, l, two_sided)
        facing = seen & (dot(side, l) > 0.0)
        reached = facing & (intensity[0] + intensity[1] + intensity[2] > 0.0)
        counts[BEHIND] += count(occupied) - count(facing)
        counts[UNREACHED] += count(facing) - count(reached)
        if not some(reached):
            continue

        # what they reflect of it without shadows
        body, highlight = reflect(packet, items, reached, side, l, geometry)
        if style.shading == CONSTANT:
            highlight = zero
        body, highlight = coloured(packet, intensity, lights.parameters[j], body, highlight, style)
        bright = reached & (brightness(body, highlight) > 0.0)
        counts[BLACK] += count(reached) - count(bright)

        # the part of it that arrives
        lit = bright
        part = select(bright, 1.0, 1.0)
        if style.shadows and scratch.hidden[a]:
            if style.shading in (CONSTANT, FLAT):  # the light is the face's, δ(p, j) the sample's
                l, distance = towards(lights.kinds[j], lights.parameters[j], origin)
            if lights.parameters[j, RADIUS] > 0.0:
                x = load_row(packet, layout.DISC)
                y = load_row(packet, layout.DISC + 1)
                l, distance = towards_disc(lights.kinds[j], lights.parameters[j], (l, distance), x, y)
            lit, part = transmittance(geometry, scratch, bright, origin, l, distance)
        elif style.shadows:
            counts[UNOBSTRUCTED] += count(bright)
        sums = add_light(sums, bright, body, highlight, lit, part)
    store_light(packet, sums)


@inline
def store_light(packet, sums):
    """Write the sums of `light_packet` to the packet, and the share of light that shadows leave."""
    diffuse, specular, unshadowed, shadowed = sums
    for c in range(3):
        store_row(packet, layout.DIFFUSE + c, diffuse[c])
        store_row(packet, layout.SPECULAR + c, specular[c])
    store_row(packet, layout.UNSHADOWED, unshadowed)
    store_row(packet, layout.SHADOWED, shadowed)
    store_row(packet, layout.SHADOW, select(unshadowed > 0.0, shadowed / unshadowed, 1.0))


@inline
def brightness(body, highlight):
    """The sum R + G + B of reflected light, diffuse and specular."""
    reflected = add(body, highlight)
    return reflected[0] + reflected[1] + reflected[2]


@inline
def add_light(sums, bright, body, highlight, lit, part):
    """Add one more light to the sums of `light_packet`.

    Args:
        bright: mask of the points that it would reach without shadows.
        body, highlight: diffuse and specular RGB that the points reflect of it.
        lit, part: mask of the points that it reaches, and the part of it that gets through.
    """
    diffuse, specular, unshadowed, shadowed = sums
    diffuse = add(diffuse, choose(lit, scale(part, body), DARK))
    specular = add(specular, choose(lit, scale(part, highlight), DARK))
    total = brightness(body, highlight)
    return diffuse, specular, unshadowed + select(bright, total, 0.0), shadowed + select(lit, part * total, 0.0)


@inline
def facing_side(packet, n, l, two_sided):
    """Normals of points on the side that light from `l` falls on, and where shadow rays start there.

    Args:
        two_sided: mask of points that can be lit from behind, too.
    """
    ahead = load3(packet, layout.ORIGIN)
    side = n
    origin = ahead
    behind = two_sided & (dot(n, l) < 0.0)
    if some(behind):
        side = choose(behind, scale(-1.0, n), n)
        origin = choose(behind, load3(packet, layout.BACK), ahead)
    return side, origin


@inline
def coloured(packet, intensity, light, body, highlight, style):
    """Diffuse and specular RGB that points reflect, of what they reflect of unit light. Args: light: its row."""
    body = multiply(multiply(multiply(intensity, triple(light, DIFFUSE)), body), load3(packet, layout.ALBEDO_MAP))
    if style.form == BOOK:
        body = scale(load_row(packet, layout.W), body)
    return body, multiply(multiply(intensity, triple(light, SPECULAR)), highlight)


@inline
def reflect(packet, items, reached, n, l, geometry):
    """Diffuse and specular RGB per unit of light from `l`, each point by its own material."""
    view = load3(packet, layout.VIEW)
    tangent = load3(packet, layout.TANGENT)
    diffuse = scale(0.0, n)
    specular = scale(0.0, n)
    left = reached
    while some(left):
        item, mask = next_object(items, left)
        d, s = terms_in_lanes(geometry.kinds[item], geometry.materials[item], n, l, view, tangent, mask)
        diffuse = choose(mask, d, diffuse)
        specular = choose(mask, s, specular)
        left = left & ~mask
    return diffuse, specular
