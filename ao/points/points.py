"""Points at which hemispheres are gathered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from obscurance.raytrace.types import AnyFloats, Float32Rows, Float32s, UInt32s


class PointArrays(NamedTuple):
    """`Points` as kernels take them."""

    origins: Float32Rows
    normals: Float32Rows
    numbers: UInt32s
    lifts: Float32Rows
    fronts: Float32Rows


@dataclass(eq=False)
class Points:
    """Points at which hemispheres are gathered.

    Attributes:
        origins, normals: float32 (k, 3), ray origins in render space and unit axes of the hemispheres.
        numbers: uint32 (k,), keys of each point's random choices.
        lifts: float32 (k, 3), of the origins from their places on the surface, from which distances count.
        fronts: float32 (k, 3), normals of the planes below which directions are closed, zero where nothing is but by
            what rays meet; or no rows.
    """

    origins: Float32s
    normals: Float32s
    numbers: UInt32s
    lifts: Float32s
    fronts: Float32s = field(default_factory=lambda: np.zeros((0, 3), np.float32))

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, selection: slice | npt.NDArray[Any]) -> Points:
        if isinstance(selection, slice):
            return self._each(lambda array: array[selection])
        rows = np.flatnonzero(selection) if selection.dtype == np.bool_ else selection
        return self._each(lambda array: array.take(rows, axis=0))

    def _each(self, change: Callable[[npt.NDArray[Any]], npt.NDArray[Any]]) -> Points:
        """Points of which each array is changed in the same way."""
        fronts = change(self.fronts) if len(self.fronts) else self.fronts
        return Points(change(self.origins), change(self.normals), change(self.numbers), change(self.lifts), fronts)

    @property
    def arrays(self) -> PointArrays:
        return PointArrays(self.origins, self.normals, self.numbers, self.lifts, self.fronts)

    @classmethod
    def empty(cls, count: int) -> Points:
        """Room for so many points with `fronts`, to be written."""
        origins, normals, lifts, fronts = np.empty((4, count, 3), np.float32)
        return cls(origins, normals, np.empty(count, np.uint32), lifts, fronts)

    @classmethod
    def lifted(cls, places: AnyFloats, origins: AnyFloats, normals: AnyFloats) -> Points:
        """Points numbered from 0. Args: places, origins, normals: (k, 3)."""
        rounded = origins.astype(np.float32)
        lifts = (rounded - places.astype(np.float64)).astype(np.float32)
        return cls(rounded, normals.astype(np.float32), np.arange(len(places), dtype=np.uint32), lifts)

    def followed_by(self, others: Points) -> Points:
        """Two sets of points one after the other; the numbers of the `others` go on from the last."""
        return Points(
            np.append(self.origins, others.origins, axis=0),
            np.append(self.normals, others.normals, axis=0),
            np.arange(len(self) + len(others), dtype=np.uint32),
            np.append(self.lifts, others.lifts, axis=0),
            self.fronts if len(self.fronts) == 0 else np.append(self.fronts, np.zeros_like(others.origins), axis=0),
        )
