"""Bakes with profiles made up for tests of files."""

import math
from dataclasses import replace

import numpy as np

from obscurance import ao


def with_profile(baked, columns=10, seed=0, limit=math.inf):
    """A bake with a profile of random numbers, the first of which are 0 and 1, of falloffs that end at a limit."""
    values = np.random.default_rng(seed).random((len(baked.w), columns), np.float32)
    values[:2, 0] = 0, 1
    lengths = 0.0051 * baked.mesh.radius * 2.0 ** np.arange(columns)
    return replace(baked, profile=ao.Profile(lengths, values, baked.mesh.radius, limit))
