"""Many bakes with the same rays: their directions are made once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import pytest

from ao.rays.directions import DirectionTable


@contextmanager
def one_direction_table() -> Iterator[None]:
    """Lines of one seed share their directions: make them once, not ninety times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DirectionTable, "make", cache(DirectionTable.make))
        yield
