"""Layout of the parameter row in which a kernel reads a material.

A material is an integer kind and one row of `WIDTH` float64. Every row begins with the same head; the model's own
parameters follow from column `MODEL` on, in the order its file states.

======== ======= ==========================================================
column   columns content
======== ======= ==========================================================
EMISSION 3       I_e, emitted RGB
AMBIENT  3       k_a, RGB reflected of unit ambient light
ALPHA    1       opacity of the pixel (Strauss: 1 − t; otherwise 1)
TWO_SIDE 1       0, or the side the normal turns to: TO_LIGHT or TO_VIEWER
GRAIN    3       unit direction of the grain, scene axes; zero: the surface's tangent is used
GLOSS    3       RGB that is mirrored of what is around, at normal incidence
GRAZING  3       the same at grazing
SLOPE    1       RMS slope of the facets that mirror it
MODEL    …       the model's parameters
======== ======= ==========================================================
"""

WIDTH = 47
EMISSION, AMBIENT, ALPHA, TWO_SIDED, GRAIN, GLOSS, GRAZING, SLOPE, MODEL = 0, 3, 6, 7, 8, 11, 14, 17, 18
TO_LIGHT, TO_VIEWER = 1.0, 2.0

LAMBERT, PHONG, BLINN_PHONG, COOK_TORRANCE, ELLIPTICAL_BECKMANN, OREN_NAYAR, STRAUSS, POULIN_FOURNIER = range(8)
WARD, ASHIKHMIN_SHIRLEY, KAJIYA = range(8, 11)
BRUSHED = (ELLIPTICAL_BECKMANN, POULIN_FOURNIER, WARD, ASHIKHMIN_SHIRLEY, KAJIYA)  # kinds that have a grain

WARD_FORMS = {"bounded": 0.0, "ward": 1.0, "duer": 2.0}
KIRCHHOFF_END = 4.0  # √τ at the end of the table of Kajiya's series
TERMS = 16  # Chebyshev coefficients in a Poulin–Fournier row
