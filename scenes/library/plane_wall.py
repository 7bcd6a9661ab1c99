"""An open plane with a wall: one hard shadow edge, one crease."""


def plane_wall() -> str:
    """TOML of the scene."""
    return """\
# An open plane with a wall, under one lamp: its shadow is bounded by straight lines, and w(p) falls towards the crease.
background = [0.3, 0.38, 0.5]

[camera]
position = [4.6, -7.4, 3.4]
target = [0.0, 0.2, 0.7]
field_of_view = 32.0

[obscurance]
half_distance = 0.8

[[objects]]
name = "floor"
builtin = "plane"
size = [12.0, 12.0]
fineness = 0.1
material = { model = "lambert", albedo = [0.6, 0.55, 0.47] }

[[objects]]
name = "wall"
builtin = "box"
size = [4.0, 0.25, 1.8]
fineness = 0.06
translate = [0.0, 0.6, 0.9]
material = { model = "oren_nayar", albedo = [0.75, 0.7, 0.62], sigma = 0.5 }

[[lights]]
light = "point"
position = [-2.2, 3.6, 4.6]
intensity = [72.0, 66.0, 55.0]

[[lights]]
light = "directional"
direction = [-0.5, 0.8, -0.6]
intensity = [0.5, 0.55, 0.62]

[[lights]]
light = "ambient"
intensity = [0.2, 0.23, 0.28]
"""
