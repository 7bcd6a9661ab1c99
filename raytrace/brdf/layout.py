"""Layout of the row of float64 in which a kernel reads a material.

Every row begins with the same head; the model's own parameters follow from column `MODEL` on, in the order its file
states.
"""

EMISSION = 0  # I_e, emitted RGB
AMBIENT = 3  # k_a, RGB reflected of unit ambient light
ALPHA = 6  # opacity of the pixel (Strauss: 1 − t; otherwise 1)
TWO_SIDED = 7  # 0, or the side the normal turns to: TO_LIGHT or TO_VIEWER
GRAIN = 8  # unit direction of the grain, scene axes; zero: the surface's tangent is used
GLOSS, GRAZING = 11, 14  # RGB that is mirrored of what is around, at normal incidence and at grazing
SLOPE = 17  # RMS slope of the facets that mirror it
BRUSHED = 18  # 1: reflects differently along and across a grain
MODEL = 19
TO_LIGHT, TO_VIEWER = 1.0, 2.0
