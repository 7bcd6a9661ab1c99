"""Bakes with a journal from the first block on, and how to interrupt them."""

from functools import partial

import numpy as np
import pytest
from meshes import hills

import ao
from ao.execute.checkpoint import Checkpoint
from raytrace.mesh.mesh import Mesh

MESH = Mesh(*hills(50))
OPTIONS = {"samples": 128, "threads": 2}
bake_surface = partial(ao.bake, method="surface")
METHODS = {"vertex": ao.bake, "surface": bake_surface}


class Stopped(Exception):
    pass


def bake(path, notify=None, stop=None, options=OPTIONS, make=ao.bake, **settings):
    """Bake `MESH` with a journal at `path`; `stop` is the fraction of the rays after which it fails."""
    messages = [] if notify is None else notify

    def progress(done, total, stage):
        if stop is not None and done >= stop * total:
            raise Stopped

    settings = {"after": 0, "every": 0} | settings
    with Checkpoint(path, notify=messages.append, **settings) as checkpoint:
        return make(MESH, checkpoint=checkpoint, progress=progress, **options)


def interrupted(path, stop=0.6, **settings):
    with pytest.raises(Stopped):
        bake(path, stop=stop, **settings)


def bits(baked):
    numbers = np.array([baked.rays, baked.rmse, *baked.rmses])
    return bits_of(baked.values, baked.errors, baked.bent_normals, baked.flags, numbers, *of_profile(baked))


def of_profile(baked):
    return [baked.profile.values, baked.profile_errors] if baked.profile else []


def bits_of(*arrays):
    return [np.ascontiguousarray(array).tobytes() for array in arrays]
