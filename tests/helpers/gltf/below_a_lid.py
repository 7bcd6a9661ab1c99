"""A square below a larger one, the lid, as glTF primitives whose layouts are the whole page, and w of its texels."""

import numpy as np
from command import succeeded
from gltf_files import HALVES, QUAD

from obscurance.ao.closed_forms import polygon_form_factor
from obscurance.raytrace.image.read import read_image

HEIGHT = 0.5
LID = [(-2, -2, HEIGHT), (2, -2, HEIGHT), (2, 2, HEIGHT), (-2, 2, HEIGHT)]
PLACES = (np.arange(16) + 0.5) / 8 - 1
W = 1 - np.array([[polygon_form_factor(LID, (x, -y, 0), (0, 0, 1)) for x in PLACES] for y in PLACES])
"""Of the texels of the square of side 2, by their centres."""
UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], "<f4")  # downwards


def plate(builder, side, height, uv=UV, **fields):
    """A square about the origin, or about the axis z."""
    piece = builder.primitive(((QUAD - (0.5, 0.5, 0)) * side + (0, 0, height)).astype("<f4"), HALVES, **fields)
    if uv is not None:
        piece["attributes"]["TEXCOORD_0"] = builder.accessor(uv, "VEC2")
    return piece


def bake(*arguments):
    return succeeded("bake", *arguments)


def image(path):
    return read_image(path)[0]["beauty"][..., 0]
