"""Frames for tests of pictures."""

import numpy as np

from obscurance.raytrace.image.formats import LAYERS
from obscurance.raytrace.image.frame import Frame

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
