"""Layout of a shading packet of sixteen points: inputs of shading, results of lighting, layers of the film.

A packet is a float32 array (WIDTH, 16), a column of the table a row of it. Positions are in render space.
The first `FILM` columns are the film's, the layers of `raytrace.image.frame` in their order.

==================== ======= ==============================================================
column               columns content
==================== ======= ==============================================================
BEAUTY               4       sum of the next four, and opacity
AMBIENT …            3 each  ambient, diffuse, specular and emitted RGB; the background counts as emitted
W                    1       obscurance w(p)
SHADOW               1       the part of the light that δ lets through
DEPTH                1       distance to the viewer, infinite where nothing is hit
NORMAL               3       unit shading normal on the viewer's side; zero reflects nothing
ALBEDO               3       the material's colour times its texture
ID                   1       row of the object plus 1, 0 for none
POINT                3       where light is gathered (a face's centroid under constant shading)
ORIGIN               3       origin of its shadow rays, safely above the surface
BACK                 3       origin of shadow rays to lights behind, if the material turns to the light
VIEW                 3       unit direction to the viewer
TANGENT              3       grain: along u, or as a texture has it; zero without texture coordinates
ALBEDO_MAP           3       albedo texture times colours of vertices, 1 without
FRONT                1       lights seen: 0 none, ON_THIS_SIDE, ON_BOTH_SIDES of the surface
UNSHADOWED, SHADOWED 1 each  luminous sum over lights without δ, and with it
OCCLUSION            1       occlusion texture, 1 without
BENT                 3       direction of what is open, of any length; zero where none is known
==================== ======= ==============================================================
"""

import numpy as np

from ..kernel.jit import inline
from ..kernel.simd import load_row, select, store_row

# Numba compiles a function anew for every constant of Python's that it is given, but only once for NumPy's.
BEAUTY, ALPHA, AMBIENT, DIFFUSE, SPECULAR, EMISSION = np.array([0, 3, 4, 7, 10, 13])
W, SHADOW, DEPTH, NORMAL, ALBEDO, ID = np.array([16, 17, 18, 19, 22, 25])
FILM = 26
POINT, ORIGIN, BACK, VIEW, TANGENT, ALBEDO_MAP = np.arange(26, 44, 3)
FRONT, UNSHADOWED, SHADOWED, OCCLUSION, BENT = np.array([44, 45, 46, 47, 48])
WIDTH = 51
THROUGH, BEGIN, BEHIND, COVER = np.array([26, 27, 28, 29])  # of layers, behind the film's columns, see `Scratch`
ON_THIS_SIDE, ON_BOTH_SIDES = 1.0, 2.0
LIGHTING = 14  # columns that lighting writes, see `lighting_column`


@inline
def load3(packet, column):
    """Three columns of a packet, from `column` on."""
    return load_row(packet, column), load_row(packet, column + 1), load_row(packet, column + 2)


@inline
def store3(packet, column, mask, a):
    """Write three columns in the lanes of the mask `mask`."""
    for c in range(3):
        store1(packet, column + c, mask, a[c])


@inline
def store1(packet, column, mask, a):
    """Write a column in the lanes of the mask `mask`."""
    store_row(packet, column, select(mask, a, load_row(packet, column)))


@inline
def lighting_column(number):
    """The columns that lighting writes, one after another: AMBIENT to EMISSION, UNSHADOWED and SHADOWED."""
    return AMBIENT + number if number < W - AMBIENT else UNSHADOWED + number - (W - AMBIENT)
