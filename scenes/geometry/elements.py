"""Elements of a PLY file as typed columns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Property:
    """A column of an element.

    Attributes:
        name: of the property.
        kind: the type of its values.
        values: (n,), or the values of all lists one after the other.
        counted, sizes: of a property of lists: the type of their lengths, and the lengths (n,).
    """

    name: str
    kind: str
    values: npt.NDArray[Any]
    counted: str = ""
    sizes: npt.NDArray[Any] | None = None

    def fitting(self) -> Property:
        """The same values in the same type if it holds them, or else in one that does."""
        kind = self.kind
        with np.errstate(all="ignore"):
            cast = self.values.astype("<" + kind)
            if not np.array_equal(cast, self.values, equal_nan=kind in "fd"):
                kind = "d"
            counted = self.counted
            if self.sizes is not None and not np.array_equal(self.sizes.astype("<" + counted), self.sizes):
                counted = "I"
        return replace(self, kind=kind, counted=counted)


@dataclass(frozen=True, eq=False)
class Element:
    """So many rows of some properties."""

    name: str
    count: int
    properties: tuple[Property, ...]
