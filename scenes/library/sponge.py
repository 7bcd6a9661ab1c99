"""A Menger sponge: creases within creases."""


def sponge() -> str:
    """TOML of the scene."""
    return """\
# A Menger sponge of three levels under a weak lamp: nearly all one sees is the ambient term times w(p).
background = [0.04, 0.04, 0.05]

[camera]
position = [2.9, -4.6, 3.1]
target = [0.0, 0.0, 0.9]
field_of_view = 30.0

[obscurance]
half_distance = 0.3

[[objects]]
builtin = "sponge"
level = 3
size = 2.0
fineness = 0.04
translate = [0.0, 0.0, 1.0]
material = { model = "lambert", albedo = [0.85, 0.6, 0.32] }

[[objects]]
name = "floor"
builtin = "plane"
size = [16.0, 16.0]
fineness = 0.1
material = { model = "lambert", albedo = 0.45 }

[[lights]]
light = "directional"
direction = [-0.75, 0.3, -0.6]
intensity = [1.1, 1.0, 0.85]

[[lights]]
light = "ambient"
intensity = [0.42, 0.45, 0.52]
"""
