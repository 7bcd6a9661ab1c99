"""A spotlit still life on a table."""


def still_life() -> str:
    """TOML of the scene."""
    return """\
# Fruit, a cup and books on a table, in the cone of one spot light; the far end is a little out of focus.
background = [0.012, 0.011, 0.01]

[camera]
position = [2.1, -5.2, 2.2]
target = [0.0, 0.0, 0.42]
field_of_view = 25.0
aperture = 0.05
focus = 5.6

[obscurance]
half_distance = 0.4

[[materials]]
name = "table"
model = "cook_torrance"
albedo = [0.3, 0.17, 0.09]
k_s = 0.15
m = 0.35

[[materials]]
name = "orange"
model = "cook_torrance"
albedo = [0.85, 0.36, 0.05]
k_s = 0.2
m = 0.4

[[materials]]
name = "linen"
model = "oren_nayar"
albedo = [0.16, 0.2, 0.27]
sigma = 0.7

[[objects]]
name = "table"
builtin = "box"
size = [5.0, 3.4, 0.2]
fineness = 0.06
translate = [0.0, 0.0, -0.1]
material = "table"

[[objects]]
name = "wall"
builtin = "plane"
size = [16.0, 9.0]
fineness = 0.3
rotate = [90.0, 0.0, 0.0]
translate = [0.0, 2.4, 1.0]
material = { model = "oren_nayar", albedo = [0.34, 0.3, 0.25], sigma = 0.6 }

[[objects]]
name = "cup"
builtin = "cylinder"
radius = 0.27
height = 0.85
fineness = 0.03
translate = [-0.62, 0.28, 0.425]
material = "strauss_copper"

[[objects]]
name = "plate"
builtin = "cylinder"
radius = 0.72
height = 0.05
fineness = 0.03
translate = [0.42, -0.12, 0.025]
material = { preset = "plastic", albedo = [0.62, 0.66, 0.7] }

[[objects]]
name = "orange"
builtin = "sphere"
radius = 0.24
fineness = 0.02
material = "orange"
copies = [
  { translate = [0.25, -0.28, 0.29] },
  { translate = [0.68, -0.02, 0.29] },
  { translate = [0.24, 0.21, 0.29] },
  { translate = [0.39, -0.03, 0.66] },
]

[[objects]]
name = "plum"
builtin = "sphere"
radius = 0.15
fineness = 0.015
scale = [1.0, 1.0, 1.15]
translate = [-0.35, -0.62, 0.17]
material = "velvet_clay"

[[objects]]
name = "apple"
builtin = "sphere"
radius = 0.21
fineness = 0.02
scale = [1.0, 1.0, 0.9]
translate = [-0.86, -0.42, 0.19]
material = "red_plastic"

[[objects]]
name = "book"
builtin = "box"
size = [1.05, 0.75, 0.13]
fineness = 0.025
material = "linen"
copies = [
  { rotate = [0.0, 0.0, 12.0], translate = [-1.35, 0.62, 0.065] },
  { rotate = [0.0, 0.0, -8.0], translate = [-1.38, 0.66, 0.195] },
]

[[lights]]
light = "spot"
position = [-2.6, -2.6, 4.4]
direction = [2.6, 2.75, -4.1]
half_angle = 21.77
exponent = 18.0
intensity = [150.0, 132.0, 100.0]

[[lights]]
light = "point"
position = [4.0, -3.0, 2.5]
intensity = [4.5, 5.4, 7.5]

[[lights]]
light = "ambient"
intensity = [0.07, 0.075, 0.09]
"""
