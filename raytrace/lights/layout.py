"""Layout of the row in which a kernel reads a light: an integer kind and `WIDTH` float64.

============== ======= ===============================================
column         columns content
============== ======= ===============================================
INTENSITY      3       RGB
POSITION       3       of point and spot lights
DIRECTION      3       unit, the way the light travels
RADIAL         3       a0, a1, a2
COS_HALF_ANGLE 1       of a spot's cone
HALF_ANGLE     1       radians
EXPONENT       1       of the cosine within the cone
INVERSE_RANGE  1       1/range, 0 without end
DIFFUSE        3       RGB in [0, 1] of INTENSITY, what is reflected diffusely
SPECULAR       3       RGB in [0, 1] of INTENSITY, what highlights reflect
============== ======= ===============================================
"""

POINT, DIRECTIONAL, SPOT, AMBIENT = range(4)
INTENSITY, POSITION, DIRECTION, RADIAL = 0, 3, 6, 9
COS_HALF_ANGLE, HALF_ANGLE, EXPONENT, INVERSE_RANGE = 12, 13, 14, 15
DIFFUSE, SPECULAR, WIDTH = 16, 19, 22

ZENITH, HORIZON, GROUND, UP, SKY_WIDTH = 0, 3, 6, 9, 12
"""Layout of the row of a sky gradient: three RGB, and the unit direction upwards."""
MAP_WIDTH, MAP_HEIGHT, MAPS, MAP_SLOPE = 128, 64, 5, 0.1
"""An image all around: texels, and how many maps there are: of slope 0, `MAP_SLOPE`, and then twice as rough each."""
