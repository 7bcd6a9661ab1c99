"""The scene of a bake's rays: placed faces in a hierarchy of our own and, when first asked for, in Embree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from obscurance.raytrace.bvh.bvh16 import BVH16, Hierarchy
from obscurance.raytrace.embree import TriangleScene
from obscurance.raytrace.mesh.opacity import PackedOpacity
from obscurance.raytrace.types import Float32s, Int32s

from .directions import DirectionTable


@dataclass(eq=False)
class RayScene:
    """Faces in render space. Pickled, they go to other processes, which build their own hierarchies.

    Attributes:
        vertices: float32 (n, 3). faces: int32 (m, 3), none degenerate. hierarchy: over the faces.
        embree: the faces in Embree, built when it is first called, which must not be on two threads at once.
        opacity: of the faces, or None. cone: of directions, `DirectionTable.make`.
    """

    vertices: Float32s
    faces: Int32s
    hierarchy: Hierarchy
    embree: Callable[[], TriangleScene]
    opacity: PackedOpacity | None = None
    cone: float = 1.0
    _last: tuple[tuple[int, int, int, int], DirectionTable] | None = None

    @classmethod
    def of(cls, vertices: Float32s, faces: Int32s, opacity: PackedOpacity | None = None, cone: float = 1.0) -> RayScene:
        """A scene of its own, with the same bits wherever it is made."""
        embree = cache(partial(TriangleScene, vertices, faces))
        return cls(vertices, faces, Hierarchy(BVH16.of(vertices, faces), vertices, faces), embree, opacity, cone)

    def __reduce__(self) -> tuple[Callable[..., RayScene], tuple[Float32s, Int32s, PackedOpacity | None, float]]:
        return RayScene.of, (self.vertices, self.faces, self.opacity, self.cone)

    def table(self, samples: int, points: int, key: np.uint32, leap: int = 1) -> DirectionTable:
        """`DirectionTable.make`, or the last one again if it is the same."""
        wanted = samples, points, int(key), leap
        if self._last is None or self._last[0] != wanted:
            self._last = wanted, DirectionTable.make(samples, points, key, leap, self.cone)
        return self._last[1]
