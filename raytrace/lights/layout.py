"""Layout of the row in which a kernel reads a light: an integer kind and `WIDTH` float64."""

POINT, DIRECTIONAL, SPOT, AMBIENT = range(4)

INTENSITY = 0  # RGB
POSITION = 3  # of point and spot lights
DIRECTION = 6  # unit, the way the light travels
RADIAL = 9  # a0, a1, a2
COS_HALF_ANGLE, HALF_ANGLE = 12, 13  # of a spot's cone, radians
EXPONENT = 14  # of the cosine within the cone
INVERSE_RANGE = 15  # 1/range, 0 without end
RADIUS = 16  # of the disc that shines; of a directional light the tangent of half its angular diameter
DIFFUSE, SPECULAR = 17, 20  # RGB in [0, 1] of INTENSITY, what is reflected diffusely, and what highlights reflect
WIDTH = 23

ZENITH, HORIZON, GROUND, UP, SKY_WIDTH = 0, 3, 6, 9, 12  # of a sky's row: three RGB, and the unit direction upwards
MAP_WIDTH, MAP_HEIGHT = 128, 64  # texels of an image all around
MAPS, MAP_SLOPE = 5, 0.1  # its maps: of slope 0, `MAP_SLOPE`, and then twice as rough each
