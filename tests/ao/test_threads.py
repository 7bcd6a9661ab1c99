"""Every way to bake: the same bits for any number of threads, others for another seed."""

from functools import partial

import pytest
from clusters import BAKES
from interrupted_bakes import bits
from meshes import hills, two_boxes

from obscurance import ao
from obscurance.ao.estimate import one_ring, scales
from obscurance.ao.execute import tracer
from obscurance.raytrace import Mesh
from obscurance.raytrace.bvh import bvh16

STEEP = hills(40)[0] * [1, 1, 40], hills(40)[1][:, ::-1]
ENTRIES = {name: bake for name, bake in BAKES.items() if name not in ("binary", "limited")} | {
    "projected": partial(ao.bake, Mesh(*hills(40)), high=Mesh(*hills(80)), cage="10%", samples=64),
    "interior filled": partial(ao.bake, Mesh(*two_boxes()), samples=16, interior="fill"),
    "many rays": partial(ao.bake, Mesh(*STEEP), "binary", samples=1024),
    "predicted": partial(ao.bake, Mesh(*hills(150)), tolerance=0.02),
}


def facts(baked):
    """All bits, and the error of interpolation where it is measured."""
    measured = getattr(baked, "interpolation", None)
    return bits(baked), measured and measured[:2]


@pytest.mark.parametrize("entry", ENTRIES)
def test_threads_and_what_saves_memory_change_nothing_and_seeds_do(entry, monkeypatch):
    """Parts of points, of edges and of cells, cells joined in every round, triangles that are let go between rays."""
    whole = facts(ENTRIES[entry](threads=1))
    assert facts(ENTRIES[entry](seed=1)) != whole
    released = []
    monkeypatch.setattr(bvh16, "_LARGE", 0)
    monkeypatch.setattr(bvh16, "give_memory_back", lambda: released.append(1))
    sizes = (tracer, "_AT_ONCE", 70), (one_ring, "_LISTED", 30), (scales, "_BLOCK", 40), (scales, "_MANY", 0)
    for module, name, size in sizes:
        monkeypatch.setattr(module, name, size)
    monkeypatch.setattr(one_ring, "_PARTS", 1 << 30)
    assert facts(ENTRIES[entry](threads=3)) == whole
    assert released
