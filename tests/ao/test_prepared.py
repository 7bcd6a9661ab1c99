"""Prepared meshes: bakes of them are bakes of the mesh, whatever was baked before or is baked at the same time."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from interrupted_bakes import bits
from meshes import hills, two_boxes
from uv_meshes import grid_charts

from obscurance import ao
from obscurance.raytrace import Mesh, OptionError

HILLS, BOXES, TURNED = Mesh(*hills(12)), Mesh(*two_boxes()), Mesh(hills(12)[0], hills(12)[1][:, ::-1])
OPTIONS = [
    {}, {"seed": 1}, {"samples": 8}, {"falloff": "binary", "threads": 1}, {"tolerance": 0.05, "samples": 256},
    {"method": "surface"}, {"interior": "mark"}, {"interior": "ignore"}, {"profile": True},
    {"only": "some"}, {"denoise": False},
]  # fmt: skip


def bakes(mesh, given):
    """A function of options that bakes `given`, the mesh or what was prepared of it."""
    some = np.arange(len(mesh.vertices)) % 3 == 0
    return lambda options: ao.bake(given, **({"samples": 16} | options | ({"only": some} if "only" in options else {})))


@pytest.mark.parametrize("mesh", [HILLS, BOXES, TURNED], ids=["hills", "partly inside", "closed in"])
def test_bakes_of_a_prepared_mesh_are_those_of_the_mesh(mesh):
    plain, prepared = bakes(mesh, mesh), bakes(mesh, ao.prepare(mesh))
    expected = [bits(plain(options)) for options in OPTIONS]
    order = [*range(len(OPTIONS)), *reversed(range(len(OPTIONS)))]
    for number in order:
        assert bits(prepared(OPTIONS[number])) == expected[number], OPTIONS[number]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda number: bits(prepared(OPTIONS[number])), order)) == [expected[n] for n in order]


def test_textures_and_fine_meshes_take_prepared_meshes():
    bake = partial(ao.bake_texture, uv=grid_charts(len(HILLS.faces)), size=32, samples=8)
    prepared = ao.prepare(HILLS)
    assert bits(bake(prepared)) == bits(bake(HILLS))
    fine = Mesh(*hills(24))
    expected = bits(ao.bake(HILLS, high=fine, cage="10%", samples=8))
    assert bits(ao.bake(prepared, high=ao.prepare(fine), cage="10%", samples=8)) == expected


def test_nothing_is_built_again():
    assert ao.bake(ao.prepare(HILLS), samples=4).seconds["build"] == 0.0


def test_a_changed_copy_is_prepared_anew():
    moved = replace(ao.prepare(HILLS), vertices=HILLS.vertices * [1, 1, 3])
    assert bits(ao.bake(moved, samples=8)) == bits(ao.bake(Mesh(moved.vertices, moved.faces), samples=8))


def test_other_normals_than_those_it_was_prepared_with_are_refused():
    prepared = ao.prepare(HILLS, normals="area")
    assert bits(ao.bake(prepared, samples=8, normals="area")) == bits(ao.bake(HILLS, samples=8, normals="area"))
    with pytest.raises(OptionError, match=r"normals: expected .area., by which the mesh was prepared, got 'file'$"):
        ao.bake(prepared)
    with pytest.raises(OptionError, match="normals: expected one of angle, area, equal, file"):
        ao.prepare(HILLS, normals="smooth")
