"""Small scene files for the tests of `obscurance render`."""

BALL = """\
[camera]
position = [0.0, -4.0, 2.0]
target = [0.0, 0.0, 0.3]

[[objects]]
name = "floor"
builtin = "plane"
size = [4.0, 4.0]
fineness = 0.1

[[objects]]
name = "ball"
builtin = "sphere"
radius = 0.5
fineness = 0.06
scale = [1.0, 1.0, 0.7]
translate = [0.0, 0.0, 0.35]
material = "red_plastic"

[[lights]]
light = "point"
position = [2.0, -2.0, 3.0]
intensity = 20.0

[[lights]]
light = "ambient"
intensity = 0.5
"""
SMALL = ("--width", 48, "--height", 32, "--samples", 4)


def write_ball(folder, text=BALL):
    """The scene in `folder`: a red, flattened ball on a grey floor, one lamp, nothing behind."""
    target = folder / "ball.toml"
    target.write_text(text)
    return target
