"""Points at which hemispheres are gathered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from raytrace.types import AnyFloats, Float32Rows, Float32s, UInt32s


class PointArrays(NamedTuple):
    """`Points` as kernels take them."""

    origins: Float32Rows
    normals: Float32Rows
    numbers: UInt32s


@dataclass(eq=False)
class Points:
    """Points at which hemispheres are gathered.

    Attributes:
        origins, normals: float32 (k, 3), ray origins in render space and unit axes of the hemispheres.
        numbers: uint32 (k,), keys of each point's random choices.
    """

    origins: Float32s
    normals: Float32s
    numbers: UInt32s

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, selection: slice | npt.NDArray[Any]) -> Points:
        if isinstance(selection, slice):
            return Points(self.origins[selection], self.normals[selection], self.numbers[selection])
        rows = np.flatnonzero(selection) if selection.dtype == np.bool_ else selection
        return Points(self.origins.take(rows, axis=0), self.normals.take(rows, axis=0), self.numbers.take(rows))

    @property
    def arrays(self) -> PointArrays:
        return PointArrays(self.origins, self.normals, self.numbers)

    def followed_by(self, origins: AnyFloats, normals: AnyFloats) -> Points:
        """These points and then others (j, 3), whose numbers go on from the last."""
        both = np.append(self.origins, origins.astype(np.float32), axis=0)
        axes = np.append(self.normals, normals.astype(np.float32), axis=0)
        return Points(both, axes, np.arange(len(both), dtype=np.uint32))
