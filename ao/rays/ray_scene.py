"""The scene of a bake's rays: placed faces in a hierarchy of our own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from obscurance.raytrace.bvh.bvh16 import BVH16, Hierarchy
from obscurance.raytrace.mesh.opacity import PackedOpacity
from obscurance.raytrace.types import Float32s, Int32s

from .directions import COSINE, DirectionTable, Lobe


@dataclass(eq=False)
class RayScene:
    """Faces in render space. Pickled, they go to other processes, which build their own hierarchies.

    Attributes:
        vertices: float32 (n, 3). faces: int32 (m, 3), none degenerate. hierarchy: over the faces.
        opacity: of the faces, or None. lobe: of directions.
    """

    vertices: Float32s
    faces: Int32s
    hierarchy: Hierarchy
    opacity: PackedOpacity | None = None
    lobe: Lobe = COSINE
    _last: tuple[tuple[int, int, int, int], DirectionTable] | None = None

    @classmethod
    def of(
        cls, vertices: Float32s, faces: Int32s, opacity: PackedOpacity | None = None, lobe: Lobe = COSINE
    ) -> RayScene:
        """A scene of its own, with the same bits wherever it is made."""
        return cls(vertices, faces, Hierarchy(BVH16.of(vertices, faces), vertices, faces), opacity, lobe)

    def __reduce__(self) -> tuple[Callable[..., RayScene], tuple[Float32s, Int32s, PackedOpacity | None, Lobe]]:
        return RayScene.of, (self.vertices, self.faces, self.opacity, self.lobe)

    def table(self, samples: int, points: int, key: np.uint32, leap: int = 1) -> DirectionTable:
        """`DirectionTable.make`, or the last one again if it is the same."""
        wanted = samples, points, int(key), leap
        if self._last is None or self._last[0] != wanted:
            self._last = wanted, DirectionTable.make(samples, points, key, leap, self.lobe)
        return self._last[1]
