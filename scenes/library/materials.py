"""A grid of spheres, one of every preset and of the models that no preset has."""

from __future__ import annotations

from raytrace.presets import PRESETS

_OTHERS = {
    "blue_phong": '{ model = "phong", k_d = [0.06, 0.14, 0.42], k_s = 0.45, exponent = 60.0 }',
    "smoked_glass": '{ model = "strauss", colour = [0.2, 0.35, 0.3], smoothness = 0.9, transparency = 0.6 }',
    "lamp": '{ model = "lambert", albedo = 0.2, emission = [0.9, 0.55, 0.2] }',
}
_COLUMNS = 4
_DISTANCE = 1.2

_HEAD = """\
# One sphere of every preset, and of the models that no preset has.
background = [0.05, 0.05, 0.06]

[camera]
position = [0.0, -9.2, 6.0]
target = [0.0, -0.12, 0.3]
field_of_view = 26.0

[obscurance]
half_distance = 0.5

[[objects]]
name = "floor"
builtin = "plane"
size = [24.0, 24.0]
fineness = 0.15
material = { model = "lambert", albedo = 0.3 }
"""

_SPHERE = """
[[objects]]
name = "{name}"
builtin = "sphere"
radius = 0.5
fineness = 0.03
translate = [{x:.1f}, {y:.1f}, 0.5]
material = {material}
"""

_LIGHTS = """
[[lights]]
light = "point"
position = [-5.0, -5.0, 7.0]
intensity = [185.0, 178.0, 165.0]

[[lights]]
light = "point"
position = [6.0, -3.0, 3.5]
intensity = [60.0, 68.0, 80.0]

[[lights]]
light = "directional"
direction = [0.1, -0.5, -0.9]
intensity = [0.9, 0.9, 0.95]

[[lights]]
light = "ambient"
intensity = 0.16
"""


def materials() -> str:
    """TOML of the scene."""
    shown = {name: f'"{name}"' for name in PRESETS} | _OTHERS
    rows = -(-len(shown) // _COLUMNS)
    spheres = []
    for number, (name, material) in enumerate(shown.items()):
        row, column = divmod(number, _COLUMNS)
        x, y = _DISTANCE * (column - (_COLUMNS - 1) / 2), _DISTANCE * ((rows - 1) / 2 - row)
        spheres.append(_SPHERE.format(name=name, x=x, y=y, material=material))
    return _HEAD + "".join(spheres) + _LIGHTS
