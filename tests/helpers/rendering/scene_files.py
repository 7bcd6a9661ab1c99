"""Scene files made by hand: TOML with what it refers to, and glTF."""

import numpy as np
from gltf_files import TRIANGLE, Builder

from obscurance.scenes.description.read import read_scene

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


SQUARE = """\
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vt .5 .5
vn 0 0 1
f 1/1/1 2/2/1 3/3/1
f 1/5/1 3/3/1 4/4/1
"""
PLAIN = '[[objects]]\nbuiltin = "plane"\nfineness = 0.5\n'


def written(folder, text, **files):
    """The path of a TOML text, in a folder with `square.obj`, `paint.png` and more files."""
    folder.mkdir(exist_ok=True)
    contents = {"square.obj": SQUARE, "paint.png": "any content: it is read when a ray has seen it", "scene.toml": text}
    for name, content in {**contents, **files}.items():
        target = folder / name
        target.parent.mkdir(exist_ok=True, parents=True)
        target.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / "scene.toml"


def scene(folder, text, **files):
    """The scene that is `written`."""
    return read_scene(written(folder, text, **files))


UV = np.array([[0, 0], [1, 0], [0, 1]], dtype="<f4")


def read(folder, builder, nodes, name="scene.glb", **fields):
    path = folder / name
    path.write_bytes(builder.glb(nodes, **fields))
    return read_scene(path)


def triangle(**fields):
    """A builder with one triangle as mesh 0."""
    builder = Builder()
    builder.mesh(builder.primitive(TRIANGLE, **fields))
    return builder


def textured(builder, image, coordinates=UV, **fields):
    """Scene fields that give the builder's only primitive a texture with that image."""
    primitive = builder.header["meshes"][0]["primitives"][0]
    primitive["material"] = 0
    if coordinates is not None:
        primitive["attributes"]["TEXCOORD_0"] = builder.accessor(coordinates, "VEC2", **fields)
    surface = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
    return {"materials": [{"pbrMetallicRoughness": surface}], "textures": [{"source": 0}], "images": [image]}
