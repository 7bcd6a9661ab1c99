"""Ambient light from a sky or an image: by the bent normal, and mirrored by what is glossy.

k_a I_a(b) w, I_a the mean light of the hemisphere about the bent normal b. Of it the part that the material's highlight
would reflect, F ≤ k_a, is F (V L + (1 − V) I_a(b) w): L comes from the mirror direction, blurred as the material is
rough, and V is the part of that which is open (`raytrace.lights.environment_kernels.cone_visibility`).
"""

from math import acos

import numpy as np

from ..brdf.ashikhmin_shirley import fifth
from ..brdf.layout import AMBIENT, GLOSS, GRAZING, SLOPE
from ..kernel.jit import inline
from ..kernel.vector import add, dot, mirror, triple, unit
from ..lights import environment_kernels as environment
from . import shading_points as layout
from .interaction import CONSTANT
from .workspace import OFF


@inline
def diffuse_ibl(lights, total, n):
    """I_a about a direction n: sum of ambient lights, `total`, of skies and of an image."""
    for sky in lights.skies:
        total = add(total, environment.sky_irradiance(sky, n))
    if len(lights.harmonics) > 0:
        total = add(total, environment.harmonic_irradiance(lights.harmonics, n))
    return total


@inline
def specular_ibl(lights, total, d, slope):
    """L from a direction d, blurred for facets of RMS `slope`."""
    for sky in lights.skies:
        total = add(total, environment.sky_radiance(sky, d, slope))
    if len(lights.harmonics) > 0:
        total = add(total, environment.map_radiance(lights.maps, lights.frame, d, slope))
    return total


@inline
def lane_triple(packet, column, lane):
    x, y, z = packet[column, lane], packet[column + 1, lane], packet[column + 2, lane]
    return np.float64(x), np.float64(y), np.float64(z)


@inline
def reflect_environment(packet, lane, row, lights, total, style):
    """Write the ambient light that a point reflects, of ambient lights, `total`, and of the environment."""
    n, v = lane_triple(packet, layout.NORMAL, lane), lane_triple(packet, layout.VIEW, lane)
    w, bent = 1.0, n
    if style.form != OFF:
        w, bent = np.float64(packet[layout.W, lane]), unit(lane_triple(packet, layout.BENT, lane))
        if dot(bent, n) <= 0.0:  # no bent normal is known, or the surface is seen from behind
            bent = n
    arriving, reflectance = diffuse_ibl(lights, total, bent), triple(row, AMBIENT)
    slope, gloss, grazing = row[SLOPE], triple(row, GLOSS), triple(row, GRAZING)
    mirrored, visible, rise = (0.0, 0.0, 0.0), 0.0, 0.0
    glossy = style.shading != CONSTANT and max(grazing[0], grazing[1], grazing[2]) > 0.0
    if glossy:
        r = mirror(n, v)
        mirrored = specular_ibl(lights, total, r, slope)
        visible = environment.cone_visibility(w, acos(max(-1.0, min(1.0, dot(bent, r)))), slope)
        rise = fifth(1.0 - max(0.0, min(1.0, dot(n, v))))
    for c in range(3):
        # in single precision, as ambient light alone is reflected
        share = np.float32(reflectance[c]) * packet[layout.ALBEDO_MAP + c, lane]
        value = np.float32(reflectance[c] * arriving[c]) * packet[layout.ALBEDO_MAP + c, lane]
        if style.form != OFF:
            value = np.float32(w) * value
        if glossy:
            part = min(np.float64(share), gloss[c] + (grazing[c] - gloss[c]) * rise)
            value = np.float32(max(0.0, value + part * visible * (mirrored[c] - arriving[c] * w)))
        packet[layout.AMBIENT + c, lane] = value
