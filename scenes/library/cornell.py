"""A closed room with coloured walls, lit from inside."""


def cornell() -> str:
    """TOML of the scene."""
    return """\
# A closed box, 2 wide, 2 high and 4 deep, with its lamp and the camera inside: no light leaves, none leaks in.
# After the Cornell box (Goral, Torrance, Greenberg & Battaile 1984).

[camera]
position = [0.0, -2.9, 1.0]
target = [0.0, 0.0, 1.0]
field_of_view = 52.0

[render]
width = 720
height = 720

[obscurance]
half_distance = 0.5

[[materials]]
name = "white"
model = "lambert"
albedo = [0.76, 0.75, 0.71]

[[materials]]
name = "red"
model = "lambert"
albedo = [0.57, 0.04, 0.03]

[[materials]]
name = "green"
model = "lambert"
albedo = [0.11, 0.41, 0.07]

[[objects]]
name = "floor"
builtin = "plane"
size = [2.0, 4.0]
fineness = 0.05
translate = [0.0, -1.0, 0.0]
material = "white"

[[objects]]
name = "ceiling"
builtin = "plane"
size = [2.0, 4.0]
fineness = 0.05
rotate = [180.0, 0.0, 0.0]
translate = [0.0, -1.0, 2.0]
material = "white"

[[objects]]
name = "back and front"
builtin = "plane"
size = [2.0, 2.0]
fineness = 0.05
material = "white"
copies = [
  { rotate = [90.0, 0.0, 0.0], translate = [0.0, 1.0, 1.0] },
  { rotate = [-90.0, 0.0, 0.0], translate = [0.0, -3.0, 1.0] },
]

[[objects]]
name = "left"
builtin = "plane"
size = [2.0, 4.0]
fineness = 0.05
rotate = [0.0, 90.0, 0.0]
translate = [-1.0, -1.0, 1.0]
material = "red"

[[objects]]
name = "right"
builtin = "plane"
size = [2.0, 4.0]
fineness = 0.05
rotate = [0.0, -90.0, 0.0]
translate = [1.0, -1.0, 1.0]
material = "green"

[[objects]]
name = "tall block"
builtin = "box"
size = [0.6, 0.6, 1.2]
fineness = 0.04
rotate = [0.0, 0.0, 17.0]
translate = [-0.35, 0.3, 0.6]
material = "white"

[[objects]]
name = "short block"
builtin = "box"
size = [0.6, 0.6, 0.6]
fineness = 0.04
rotate = [0.0, 0.0, -18.0]
translate = [0.35, -0.3, 0.3]
material = "white"

[[objects]]
name = "lamp"
builtin = "plane"
size = [0.5, 0.4]
rotate = [180.0, 0.0, 0.0]
translate = [0.0, -0.1, 1.99]
material = { model = "lambert", albedo = 0.5, emission = [1.0, 0.9, 0.7] }

# A spot light over a whole hemisphere with exponent 1 shines as a small panel does.
[[lights]]
light = "spot"
position = [0.0, -0.1, 1.97]
direction = [0.0, 0.0, -1.0]
half_angle = 90.0
exponent = 1.0
intensity = [11.5, 10.3, 8.2]

[[lights]]
light = "ambient"
intensity = [0.2, 0.19, 0.17]
"""
