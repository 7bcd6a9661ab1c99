"""Layout of the row in which a kernel reads a material: an integer kind and `WIDTH` float64.

Every row begins with the same head; the model's own parameters follow from column `MODEL` on, in the order its file
states.
"""

WIDTH = 47
EMISSION = 0  # I_e, emitted RGB
AMBIENT = 3  # k_a, RGB reflected of unit ambient light
ALPHA = 6  # opacity of the pixel (Strauss: 1 − t; otherwise 1)
TWO_SIDED = 7  # 0, or the side the normal turns to: TO_LIGHT or TO_VIEWER
GRAIN = 8  # unit direction of the grain, scene axes; zero: the surface's tangent is used
GLOSS, GRAZING = 11, 14  # RGB that is mirrored of what is around, at normal incidence and at grazing
SLOPE = 17  # RMS slope of the facets that mirror it
MODEL = 18
TO_LIGHT, TO_VIEWER = 1.0, 2.0

LAMBERT, PHONG, BLINN_PHONG, COOK_TORRANCE, ELLIPTICAL_BECKMANN, OREN_NAYAR, STRAUSS, POULIN_FOURNIER = range(8)
WARD, ASHIKHMIN_SHIRLEY, KAJIYA = range(8, 11)
BRUSHED = (ELLIPTICAL_BECKMANN, POULIN_FOURNIER, WARD, ASHIKHMIN_SHIRLEY, KAJIYA)  # kinds that have a grain

WARD_FORMS = {"bounded": 0.0, "ward": 1.0, "duer": 2.0}
KIRCHHOFF_END = 4.0  # √τ at the end of the table of Kajiya's series
TERMS = 16  # Chebyshev coefficients in a Poulin–Fournier row
