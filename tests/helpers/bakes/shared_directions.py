"""Many bakes of which only w is looked at: their directions are made once, what lies between vertices is left out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache

import pytest

from obscurance import ao
from obscurance.ao.rays.directions import DirectionTable
from obscurance.ao.result import NOWHERE
from obscurance.raytrace import Mesh
from obscurance.scenes.validation.configurations import Configuration


@contextmanager
def only_w() -> Iterator[None]:
    """Bakes of one seed share their directions; what interpolation errs by, a third of the time, is not measured."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DirectionTable, "make", cache(DirectionTable.make))
        patch.setattr("obscurance.ao.baking.measure_interpolation", lambda *_: NOWHERE)
        yield


@cache
def prepared_mesh(mesh: Mesh, normals: ao.options.Normals) -> ao.PreparedMesh:
    return ao.prepare(mesh, normals)


def prepared(lines: Sequence[Configuration]) -> list[Configuration]:
    """The lines, of which all that a bake does before its first ray is done once."""
    return [replace(line, mesh=prepared_mesh(line.mesh, line.options["normals"])) for line in lines]
