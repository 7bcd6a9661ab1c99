"""Bakes in small blocks that are kept from the first one on, and how to interrupt them."""

from functools import partial
from unittest.mock import patch

import numpy as np
import pytest
from meshes import hills

from obscurance import ao
from obscurance.ao.execute.kept import Kept
from obscurance.ao.execute.work import make_on_threads
from obscurance.raytrace.mesh.mesh import Mesh

MESH = Mesh(*hills(36))
OPTIONS = {"samples": 128, "threads": 2}
SMALL_BLOCKS = "obscurance.ao.execute.work._BLOCK_RAYS", 1 << 14
bake_surface = partial(ao.bake, method="surface")
METHODS = {"vertex": ao.bake, "surface": bake_surface}


def bake_texture(mesh, **options):
    """The texture of a mesh above the plane of x and y."""
    return ao.bake_texture(mesh, 0.45 * mesh.vertices[:, :2] + 0.5, **{"size": 80} | options)


class Stopped(Exception):
    pass


class Tracing:
    """`make_on_threads`, and how many rows it has made: those that are kept it never sees."""

    rows = 0

    def make(self, *arguments):
        for start, stop in make_on_threads(*arguments):
            self.rows += stop - start
            yield start, stop


def bake(output, notify=None, stop=None, options=OPTIONS, make=ao.bake, mesh=MESH, watch=None, **settings):
    """Bake a mesh, and keep its rows beside `output`.

    Args: notify: a list for messages, or a function. stop: the fraction of the rays after which it fails.
        watch: called with the rays so far and in all. make_rows: in place of `make_on_threads`. after: as of `Kept`.
    """
    notify = getattr(notify, "append", notify) or (lambda _: None)
    settings = {"after": 0, "make": settings.pop("make_rows", make_on_threads)} | settings

    def progress(done, total, stage):
        if not stage.startswith("rays"):
            return
        if watch:
            watch(done, total)
        if stop is not None and done >= stop * total:
            raise Stopped

    with patch(*SMALL_BLOCKS), Kept(output, notify, **settings) as kept:
        return make(mesh, checkpoint=kept, progress=progress, **options)


def interrupted(output, stop=0.6, **settings):
    with pytest.raises(Stopped):
        bake(output, stop=stop, **settings)


def folders(output):
    return sorted(output.parent.glob(f"{output.name}.partial-*"))


def bits(baked):
    """All that a bake has found, of vertices, faces or a texture."""
    last = baked.covered if isinstance(baked, ao.BakedTexture) else baked.flags
    profile = [baked.profile.values, baked.profile_errors] if baked.profile else []
    numbers = np.array([baked.rays, baked.rmse, *baked.rmses])
    arrays = [baked.values, baked.errors, baked.bent_normals, last, numbers, *profile]
    return [np.ascontiguousarray(array).tobytes() for array in arrays]
