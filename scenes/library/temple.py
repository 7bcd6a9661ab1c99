"""A colonnade in the evening sun."""


def temple() -> str:
    """TOML of the scene."""
    return """\
# A small colonnade on steps: deep creases between columns and beams, where w(p) does its work.
background = [0.35, 0.47, 0.68]

[camera]
position = [7.6, -15.2, 5.2]
target = [-0.1, 0.0, 1.7]
field_of_view = 27.0

[obscurance]
half_distance = "25%"

[[objects]]
builtin = "temple"
fineness = 0.07
material = { model = "oren_nayar", albedo = [0.72, 0.66, 0.56], sigma = 0.35 }

[[objects]]
name = "ground"
builtin = "plane"
size = [60.0, 60.0]
fineness = 0.5
translate = [0.0, 0.0, -0.1]
material = { model = "oren_nayar", albedo = [0.36, 0.34, 0.27], sigma = 0.6 }

[[lights]]
light = "directional"
direction = [0.62, 0.72, -0.62]
intensity = [2.9, 2.55, 2.0]

[[lights]]
light = "ambient"
intensity = [0.36, 0.43, 0.56]
"""
