"""Where hemispheres are gathered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Points:
    """Where hemispheres are gathered.

    Attributes:
        origins, normals: float32 (k, 3), ray origins in placed units and unit axes of the hemispheres.
        numbers: uint32 (k,), what each point's random choices are keyed by.
    """

    origins: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    numbers: npt.NDArray[np.uint32]

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, which: slice | npt.NDArray[Any]) -> Points:
        return Points(self.origins[which], self.normals[which], self.numbers[which])
