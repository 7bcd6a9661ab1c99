"""Frames of numbers, and pictures on disk as others see them."""

import subprocess
import sys

import numpy as np
import OpenImageIO as oiio
import PIL.Image
from project import environment

from obscurance.raytrace.image.formats import FORMATS, LAYERS
from obscurance.raytrace.image.frame import Frame

ENDINGS = tuple(FORMATS)
PICTURES = [ending for ending in ENDINGS if ending != ".exr"]


def foreign(path):
    """The file as OpenImageIO reads it by itself: channel names, and floats."""
    image = oiio.ImageInput.open(str(path))
    return image.spec(), image.read_image("float")


def pillow(path):
    with PIL.Image.open(path) as picture:
        return picture.copy()


def python(code, *arguments):
    """Run code in a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False, env=environment()
    )


def names(folder):
    return sorted(entry.name for entry in folder.iterdir())


METADATA = {"scene": "Säule “7”: a=b", "seed": "7", "version": "0.1.0", "samples": "16", "obscurance": "off"}


def frame(height=70, width=90, seed=0):
    """Every layer with its own values; pixels of the left column have no coverage."""
    rng = np.random.default_rng(seed)
    layers = {name: rng.random((height, width, count), np.float32) for name, count in LAYERS.items()}
    layers["object_id"] = rng.integers(0, 1 << 24, (height, width, 1)).astype(np.float32)
    layers["depth"][0, 0] = np.inf
    layers["normal"] = 2 * layers["normal"] - 1
    for name in ("ambient", "diffuse", "specular", "emission"):
        layers[name][:, 0] = 0
    layers["beauty"][..., :3] = layers["ambient"] + layers["diffuse"] + layers["specular"] + layers["emission"]
    layers["beauty"][:, 0, 3] = 0
    return Frame(layers, {}, {}, {})


def plain(colour, height=20, width=30):
    """A frame of one RGBA colour and no other layer."""
    return Frame({"beauty": np.full((height, width, 4), colour, np.float32)}, {}, {}, {})
