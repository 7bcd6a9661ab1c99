"""Many bakes of which only w is looked at: their directions are made once, what lies between vertices is left out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import pytest

from ao.rays.directions import DirectionTable
from ao.result import NOWHERE


@contextmanager
def only_w() -> Iterator[None]:
    """Bakes of one seed share their directions; what interpolation errs by, a third of the time, is not measured."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DirectionTable, "make", cache(DirectionTable.make))
        patch.setattr("ao.baking.measure_interpolation", lambda *_: NOWHERE)
        yield
