"""Scenes of glTF files made by hand, for the tests."""

import numpy as np
from gltf_files import TRIANGLE, Builder

from obscurance.scenes.description.read import read_scene

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
